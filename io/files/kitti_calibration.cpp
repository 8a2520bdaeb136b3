#include "io/files/kitti_calibration.hpp"

#include <map>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

using Projection = Eigen::Matrix<double, 3, 4>;

/// "P0: p11 p12 ... p34": the 3x4 projection matrix K (I | t) of a rectified camera, whose points are x_grey
/// + t; P1's last column is (-fx b, 0, 0).
std::map<std::string, Projection> read_kitti_projections(const fs::path& file) {
  std::map<std::string, Projection> projections;
  for (const TextLine& line : read_text_lines(file)) {
    const auto fields = split_fields(line.text);
    if (fields[0].size() != 3 || fields[0][0] != 'P' || fields[0][2] != ':') continue;
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

const Projection& projection(const fs::path& file, const std::map<std::string, Projection>& projections,
                             const std::string& key) {
  const auto found = projections.find(key);
  if (found == projections.end()) throw IoError(file, fmt::format("key '{}' is missing", key));
  return found->second;
}

/// K^-1 column, where K is that of P and `column` the last one of a projection or the difference of two.
Vector3 shift_of(const Projection& P, const Vector3& column) {
  const double z = column.z();
  return {(column.x() - P(0, 2) * z) / P(0, 0), (column.y() - P(1, 2) * z) / P(1, 1), z};
}

}  // namespace

Calibration read_kitti_calibration(const fs::path& file, KittiPair pair) {
  const auto projections = read_kitti_projections(file);
  const bool grey = pair == KittiPair::kGrey;
  const std::string left_key = grey ? "P0" : "P2", right_key = grey ? "P1" : "P3";
  const Projection& left = projection(file, projections, left_key);
  Calibration calibration;
  calibration.kind = SensorKind::kMono;
  calibration.left.pinhole = {left(0, 0), left(1, 1), left(0, 2), left(1, 2), 0, 0};
  calibration.already_rectified = true;
  if (!projections.contains(right_key)) return calibration;
  const Projection& right = projections.at(right_key);
  if ((left.leftCols<3>() - right.leftCols<3>()).norm() > 1e-6) {
    throw IoError(file, fmt::format("{} and {} differ in more than the baseline: this is no rectified pair",
                                    left_key, right_key));
  }
  const Vector3 between = shift_of(left, left.col(3) - right.col(3));
  const double baseline = between.x();
  if (!(baseline > 0)) {
    throw IoError(file,
                  fmt::format("key '{}' gives a baseline of {} m, must be positive", right_key, baseline));
  }
  calibration.kind = SensorKind::kStereo;
  calibration.right = calibration.left;
  constexpr double kPure = 1e-4;  // of the baseline
  calibration.already_rectified = between.tail<2>().norm() <= kPure * baseline;
  calibration.T_right_left =
      SE3(SO3(), calibration.already_rectified ? Vector3(-baseline, 0, 0) : Vector3(-between));
  return calibration;
}

SE3 read_kitti_colour_in_grey(const fs::path& file) {
  const auto projections = read_kitti_projections(file);
  const Projection& grey = projection(file, projections, "P0");
  const Projection& colour = projection(file, projections, "P2");
  return {SO3(), Vector3(-shift_of(colour, colour.col(3) - grey.col(3)))};
}

bool looks_like_kitti_calibration(const fs::path& file) {
  const auto lines = read_text_lines(file);
  return !lines.empty() && lines[0].text.size() > 3 && lines[0].text[0] == 'P' && lines[0].text[2] == ':' &&
         file.extension() != ".yaml" && file.extension() != ".yml";
}

}  // namespace twofold
