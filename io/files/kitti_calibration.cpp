#include "io/files/kitti_calibration.hpp"

#include <map>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

using Projection = Eigen::Matrix<double, 3, 4>;

/// "P0: p11 p12 ... p34": the 3x4 projection matrix of a rectified camera; P1's last column is (-fx b, 0, 0).
std::map<std::string, Projection> read_kitti_projections(const fs::path& file) {
  std::map<std::string, Projection> projections;
  for (const TextLine& line : read_text_lines(file)) {
    const auto fields = split_fields(line.text);
    if (fields[0] != "P0:" && fields[0] != "P1:") continue;
    if (fields.size() != 13) {
      throw IoError(file, line.number,
                    fmt::format("key {} has {} numbers, not 12", fields[0], fields.size() - 1));
    }
    Projection P;
    for (int i = 0; i < 12; ++i)
      P(i / 4, i % 4) = number_field(file, line.number, fields[static_cast<std::size_t>(i) + 1]);
    projections[std::string(fields[0].substr(0, 2))] = P;
  }
  return projections;
}

}  // namespace

Calibration read_kitti_calibration(const fs::path& file) {
  const auto projections = read_kitti_projections(file);
  const auto left = projections.find("P0");
  if (left == projections.end()) throw IoError(file, "key 'P0' is missing");
  const Projection& P0 = left->second;
  Calibration calibration;
  calibration.kind = SensorKind::kMono;
  calibration.left.pinhole = {P0(0, 0), P0(1, 1), P0(0, 2), P0(1, 2), 0, 0};
  calibration.already_rectified = true;
  const auto right = projections.find("P1");
  if (right == projections.end()) return calibration;
  const Projection& P1 = right->second;
  if ((P0.leftCols<3>() - P1.leftCols<3>()).norm() > 1e-6) {
    throw IoError(file, "P0 and P1 differ in more than the baseline: this is no rectified pair");
  }
  const double baseline = (P0(0, 3) - P1(0, 3)) / P0(0, 0);
  if (!(baseline > 0))
    throw IoError(file, fmt::format("key 'P1' gives a baseline of {} m, must be positive", baseline));
  calibration.kind = SensorKind::kStereo;
  calibration.right = calibration.left;
  calibration.T_right_left = SE3(SO3(), Vector3(-baseline, 0, 0));
  return calibration;
}

bool looks_like_kitti_calibration(const fs::path& file) {
  const auto lines = read_text_lines(file);
  return !lines.empty() && lines[0].text.size() > 3 && lines[0].text[0] == 'P' && lines[0].text[2] == ':' &&
         file.extension() != ".yaml" && file.extension() != ".yml";
}

}  // namespace twofold
