#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/files/calibration_file.hpp"
#include "io/files/output_file.hpp"

namespace twofold {
namespace {

std::string camera_text(const CameraModel& model) {
  const PinholeCamera& c = model.pinhole;
  std::string text = fmt::format("  - size: [{}, {}]\n    intrinsics: [{:.9g}, {:.9g}, {:.9g}, {:.9g}]\n",
                                 c.width, c.height, c.fx, c.fy, c.cx, c.cy);
  if (model.distortion.is_identity()) return text;
  const auto& k = model.distortion.coefficients;
  const bool without_k3 = model.distortion.model == DistortionModel::kRadTan && k[4] == 0;
  const int count = without_k3 ? 4 : model.distortion.coefficient_count();
  std::vector<std::string> values;
  values.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) values.push_back(fmt::format("{:.9g}", k[i]));
  return text + fmt::format("    distortion:\n      model: {}\n      coefficients: [{}]\n",
                            distortion_name(model.distortion.model), fmt::join(values, ", "));
}

std::string quality_text(const CalibrationQuality& quality) {
  std::string text =
      fmt::format("quality:\n  board: \"{}\"\n  views: {}\n  rms_px: {:.4f}\n  focal_std_px: {:.4f}\n",
                  quality.board, quality.views, quality.rms_px, quality.focal_std_px);
  if (quality.baseline_std) text += fmt::format("  baseline_std: {:.3g}\n", *quality.baseline_std);
  return text;
}

}  // namespace

void write_calibration(const std::filesystem::path& file, const Calibration& calibration,
                       const CalibrationQuality& quality) {
  const bool stereo = calibration.kind == SensorKind::kStereo;
  std::string text = fmt::format("sensor: {}\n", stereo ? "stereo" : "mono");
  if (calibration.fps > 0) text += fmt::format("fps: {:g}\n", calibration.fps);
  if (calibration.readout) text += fmt::format("readout: {:.6g}\n", *calibration.readout);
  text += "cameras:\n" + camera_text(calibration.left);
  if (stereo) {
    text += camera_text(calibration.right);
    const Matrix4 T = calibration.T_right_left.matrix();
    std::vector<std::string> rows;
    rows.reserve(4);
    for (int i = 0; i < 4; ++i)
      rows.push_back(fmt::format("{:.12g}, {:.12g}, {:.12g}, {:.12g}", T(i, 0), T(i, 1), T(i, 2), T(i, 3)));
    text += fmt::format("T_right_left: [{}]\n", fmt::join(rows, ",  "));
  }
  write_file(file, text + quality_text(quality));
}

}  // namespace twofold
