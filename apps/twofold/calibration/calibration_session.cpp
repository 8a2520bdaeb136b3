#include "apps/twofold/calibration/calibration_session.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "calibration/calibrate.hpp"
#include "calibration/view_collector.hpp"
#include "io/files/calibration_file.hpp"
#include "io/files/io_error.hpp"
#include "io/plots/plot.hpp"
#include "io/plots/residual_plot.hpp"

namespace twofold {
namespace {

/// A finished calibration on its way to the disk.
struct Result {
  Calibration calibration;
  CalibrationQuality quality;
  std::vector<ResidualPanel> panels;
  std::string text;
};

ResidualPanel panel_of(const std::string& name, const CameraFit& fit) {
  const PinholeCamera& camera = fit.model.pinhole;
  ResidualPanel panel{fmt::format("{}: {} views, rms {:.3f} px", name, fit.used.size(), fit.rms_px),
                      {camera.width, camera.height},
                      {},
                      {}};
  for (const ViewResiduals& view : fit.residuals) {
    panel.pixels.insert(panel.pixels.end(), view.pixels.begin(), view.pixels.end());
    panel.residuals.insert(panel.residuals.end(), view.residuals.begin(), view.residuals.end());
  }
  return panel;
}

std::string text_of(const std::string& name, const CameraFit& fit) {
  const PinholeCamera& c = fit.model.pinhole;
  const auto& k = fit.model.distortion.coefficients;
  return fmt::format(
      "{:<8} fx {:.2f} +- {:.2f}  fy {:.2f} +- {:.2f}  cx {:.2f} +- {:.2f}  cy {:.2f} +- {:.2f}\n"
      "         k1 {:.5f}  k2 {:.5f}  p1 {:.5f}  p2 {:.5f}\n"
      "         {} views, corners in {:.0f} % of the image, reprojection error {:.3f} px\n",
      name, c.fx, fit.fx_std, c.fy, fit.fy_std, c.cx, fit.cx_std, c.cy, fit.cy_std, k[0], k[1], k[2], k[3],
      fit.used.size(), 100 * fit.coverage, fit.rms_px);
}

double focal_std(const CameraFit& fit) {
  return std::max(fit.fx_std, fit.fy_std);
}

tl::expected<Result, std::string> solve_mono(const std::vector<ViewPair>& chosen, cv::Size size,
                                             const CalibrationRequest& request) {
  std::vector<BoardView> views;
  for (const ViewPair& pair : chosen) views.push_back(pair.left);
  return calibrate_camera(views, request.board, size).map([&](const CameraFit& fit) {
    Result result;
    result.calibration.kind = SensorKind::kMono;
    result.calibration.left = fit.model;
    result.quality = {request.board_text, static_cast<int>(fit.used.size()), fit.rms_px, focal_std(fit),
                      std::nullopt};
    result.panels = {panel_of("camera", fit)};
    result.text = text_of("camera", fit);
    return result;
  });
}

tl::expected<Result, std::string> solve_stereo(const std::vector<ViewPair>& chosen, cv::Size size,
                                               const CalibrationRequest& request) {
  return calibrate_stereo(chosen, request.board, size).map([&](const StereoFit& fit) {
    Result result;
    result.calibration = fit.calibration;
    result.quality = {request.board_text, static_cast<int>(fit.left.used.size()), fit.rms_px,
                      std::max(focal_std(fit.left), focal_std(fit.right)), fit.baseline_std};
    result.panels = {panel_of("left", fit.left), panel_of("right", fit.right)};
    result.text = text_of("left", fit.left) + text_of("right", fit.right) +
                  fmt::format("baseline {:.5f} m +- {:.5f}\n",
                              fit.calibration.T_right_left.translation().norm(), fit.baseline_std);
    return result;
  });
}

ViewCollector collect(FrameSource& source, cv::Size size, const CalibrationRequest& request,
                      const std::atomic<bool>& stop, const std::function<void(const std::string&)>& say) {
  ViewGuideOptions options;
  options.wanted_views = request.views;
  options.most_views = std::max(options.most_views, request.views);
  ViewCollector collector(request.board, {size, source.rig().kind == SensorKind::kStereo, source.is_live()},
                          options);
  std::string said;
  while (!stop.load(std::memory_order_relaxed)) {  // relaxed: it carries no other data
    Frame frame;
    const FrameStatus status = source.next(frame);
    if (status == FrameStatus::kError) throw IoError(source.error());
    if (status == FrameStatus::kEnd) break;
    collector.look(frame);
    if (std::string text = collector.progress(); text != said) say(said = std::move(text));
    if (source.is_live() && collector.complete()) break;
  }
  return collector;
}

}  // namespace

std::string calibrate_from(FrameSource& source, const CalibrationRequest& request,
                           const std::atomic<bool>& stop,
                           const std::function<void(const std::string&)>& say) {
  const SensorKind kind = source.rig().kind;
  if (kind == SensorKind::kRgbd)
    throw IoError("a depth camera cannot be calibrated; calibrate its grey camera alone");
  const cv::Size size(source.rig().camera.width, source.rig().camera.height);
  const ViewCollector collector = collect(source, size, request, stop, say);
  const auto chosen = collector.chosen();
  const std::string seen = fmt::format("{} frames, the board found in {}, {} views chosen",
                                       collector.frames(), collector.found(), chosen.size());
  const auto refuse = [&](const std::string& reason) {
    throw std::runtime_error(fmt::format("no calibration: {} ({})", reason, seen));
  };
  if (collector.found() == 0) refuse("the board was never seen; is --board right?");
  const auto result =
      kind == SensorKind::kStereo ? solve_stereo(chosen, size, request) : solve_mono(chosen, size, request);
  if (!result) refuse(result.error());
  write_calibration(request.out, result->calibration, result->quality);
  write_png(request.plot, draw_residuals(result->panels));
  return fmt::format("{}\n{}written to {}, residuals drawn in {}\n", seen, result->text, request.out.string(),
                     request.plot.string());
}

}  // namespace twofold
