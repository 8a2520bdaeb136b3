#include "apps/twofold/calibration/calibration_session.hpp"

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/plots/plot.hpp"
#include "io/plots/residual_plot.hpp"
#include "slam/frame_pixels.hpp"

namespace twofold {
namespace {

ResidualPanel panel_of(const std::string& name, const CalibratedCamera& camera) {
  ResidualPanel panel{fmt::format("{}: {} views, rms {:.3f} px", name, camera.views, camera.rms_px),
                      {camera.width, camera.height},
                      {},
                      {}};
  for (const CalibratedCamera::Corner& corner : camera.corners) {
    panel.pixels.emplace_back(static_cast<float>(corner.x), static_cast<float>(corner.y));
    panel.residuals.emplace_back(static_cast<float>(corner.dx), static_cast<float>(corner.dy));
  }
  return panel;
}

std::string text_of(const std::string& name, const CalibratedCamera& c) {
  const auto& k = c.distortion;
  return fmt::format(
      "{:<8} fx {:.2f} +- {:.2f}  fy {:.2f} +- {:.2f}  cx {:.2f} +- {:.2f}  cy {:.2f} +- {:.2f}\n"
      "         k1 {:.5f}  k2 {:.5f}  p1 {:.5f}  p2 {:.5f}\n"
      "         {} views, corners in {:.0f} % of the image, reprojection error {:.3f} px\n",
      name, c.fx, c.fx_std, c.fy, c.fy_std, c.cx, c.cx_std, c.cy, c.cy_std, k[0], k[1], k[2], k[3], c.views,
      100 * c.coverage, c.rms_px);
}

std::string text_of(const BoardCalibration& calibration) {
  if (!calibration.right) return text_of("camera", calibration.left);
  return text_of("left", calibration.left) + text_of("right", *calibration.right) +
         fmt::format("baseline {:.5f} m +- {:.5f}\n", calibration.baseline, calibration.baseline_std);
}

std::vector<ResidualPanel> panels_of(const BoardCalibration& calibration) {
  if (!calibration.right) return {panel_of("camera", calibration.left)};
  return {panel_of("left", calibration.left), panel_of("right", *calibration.right)};
}

BoardCalibrator collect(FrameSource& source, const CalibrationRequest& request, const std::atomic<bool>& stop,
                        const std::function<void(const std::string&)>& say) {
  const Rig& rig = source.rig();
  const bool stereo = rig.kind == SensorKind::kStereo;
  const bool somebody_moves = source.is_live() || request.video;
  BoardCalibrator calibrator(
      {request.board, rig.camera.width, rig.camera.height, stereo, somebody_moves, request.views});
  std::string said;
  while (!stop.load(std::memory_order_relaxed)) {  // relaxed: it carries no other data
    Frame frame;
    const FrameStatus status = source.next(frame);
    if (status == FrameStatus::kError) throw IoError(source.error());
    if (status == FrameStatus::kEnd) break;
    calibrator.look(view_of(stereo ? Sensor::kStereo : Sensor::kMono, frame));
    if (std::string text = calibrator.progress(); text != said) say(said = std::move(text));
    if (somebody_moves && calibrator.complete()) break;
  }
  return calibrator;
}

}  // namespace

std::string calibrate_from(FrameSource& source, const CalibrationRequest& request,
                           const std::atomic<bool>& stop,
                           const std::function<void(const std::string&)>& say) {
  if (source.rig().kind == SensorKind::kRgbd)
    throw IoError("a depth camera cannot be calibrated; calibrate its grey camera alone");
  const BoardCalibrator calibrator = collect(source, request, stop, say);
  const BoardCalibration calibration = calibrator.calibrate();
  save_calibration(calibration, request.out);
  write_png(request.plot, draw_residuals(panels_of(calibration)));
  return fmt::format(
      "{} frames, the board found in {}, {} views chosen\n{}written to {}, residuals drawn in {}\n",
      calibrator.frames(), calibrator.found(), calibrator.chosen(), text_of(calibration),
      request.out.string(), request.plot.string());
}

}  // namespace twofold
