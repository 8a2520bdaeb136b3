#include "calibration/refusal.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace twofold {

std::string refusal_of_views(const std::vector<BoardView>& views, cv::Size size,
                             const CalibrationOptions& options) {
  if (static_cast<int>(views.size()) < options.min_views)
    return fmt::format("too few views: {}, at least {} that differ are needed", views.size(),
                       options.min_views);
  Coverage coverage;
  for (const BoardView& view : views) coverage.add(view, size);
  if (coverage.share() < options.min_coverage) {
    return fmt::format(
        "poor coverage: corners in {:.0f} % of the image, {:.0f} % are needed; show the board near the "
        "edges and corners of the image, too",
        100 * coverage.share(), 100 * options.min_coverage);
  }
  return "";
}

std::string refusal_of_tilts(const std::vector<ViewShape>& shapes, const CalibrationOptions& options) {
  const int tilted = tilted_views(shapes, options.min_tilt);
  if (tilted >= options.min_tilted) return "";
  return fmt::format(
      "degenerate: the board has the same tilt in all but {} views, so focal length and distance cannot be "
      "told apart; "
      "tilt it by 20 to 40 degrees in every direction, in at least {} views",
      tilted, options.min_tilted);
}

std::string refusal_of_error(double rms_px, const CalibrationOptions& options) {
  if (rms_px <= options.max_rms_px) return "";
  return fmt::format(
      "high reprojection error: {:.2f} px, {:.2f} is the most; is the board flat, are its size and "
      "the lens model right, are the images sharp?",
      rms_px, options.max_rms_px);
}

std::string refusal_of_fit(const CameraFit& fit, const CalibrationOptions& options) {
  if (auto reason = refusal_of_error(fit.rms_px, options); !reason.empty()) return reason;
  const PinholeCamera& camera = fit.model.pinhole;
  const double worst = std::max(fit.fx_std / camera.fx, fit.fy_std / camera.fy);
  if (!(worst <= options.max_focal_std)) {  // also when it is not a number
    return fmt::format(
        "focal length uncertain: standard deviation {:.2f} %, {:.2f} % is the most; more views with "
        "more tilt, nearer to the camera",
        100 * worst, 100 * options.max_focal_std);
  }
  if (auto reason = fit.model.invalid_reason(); !reason.empty()) return reason;
  return "";
}

std::string refusal_of_baseline(double baseline, double deviation, const CalibrationOptions& options) {
  if (deviation <= options.max_baseline_std * baseline) return "";  // not when it is not a number
  return fmt::format(
      "baseline uncertain: {:.4f} m, standard deviation {:.2f} %, {:.2f} % is the most; more views, nearer "
      "to the cameras",
      baseline, 100 * deviation / baseline, 100 * options.max_baseline_std);
}

}  // namespace twofold
