#pragma once

#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "calibration/board.hpp"
#include "camera/calibration.hpp"

namespace twofold {

/// What a calibration must reach; below it is refused.
struct CalibrationOptions {
  int min_views = 10;               ///< >= 3
  double min_coverage = 0.6;        ///< share of the image's cells (Coverage) with a corner, in [0, 1]
  int min_tilted = 4;               ///< views tilted against the middle one by more than min_tilt, >= 0
  double min_tilt = 0.15;           ///< [rad] >= 0
  double max_rms_px = 0.7;          ///< reprojection error per corner, root mean square, > 0
  double max_focal_std = 0.003;     ///< standard deviation of fx, fy by themselves, > 0
  double max_baseline_std = 0.005;  ///< of the baseline by itself, > 0
  double outlier = 3.0;             ///< views with so many times the median error are left out, >= 0; 0: none

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Corners of one view and how far they are from where the calibrated camera sees them.
struct ViewResiduals {
  std::vector<cv::Point2f> pixels;
  std::vector<cv::Point2f> residuals;  ///< observed minus projected [px]
};

struct CameraFit {
  CameraModel model;  ///< radial-tangential: k1 k2 p1 p2
  double rms_px = 0;
  double fx_std = 0, fy_std = 0, cx_std = 0, cy_std = 0;  ///< one standard deviation [px]
  double coverage = 0;                                    ///< see Coverage
  std::vector<int> used;                                  ///< indices of the views that were used
  std::vector<ViewResiduals> residuals;                   ///< one a used view
};

struct StereoFit {
  Calibration calibration;
  CameraFit left, right;    ///< as optimised together; standard deviations are those of each alone
  double rms_px = 0;        ///< of all corners of both
  double baseline_std = 0;  ///< [m], from the scatter of the single pairs' relative poses
};

/// Calibrates one camera from views of a flat board (Zhang, PAMI 2000; OpenCV's solver).
///
/// @param size  of the images; views must be of them
/// Error: why the calibration is refused and what to do: too few views, poor coverage, all views alike in
/// tilt (then focal length and distance cannot be told apart), high reprojection error, uncertain focal
/// length.
[[nodiscard]] tl::expected<CameraFit, std::string> calibrate_camera(const std::vector<BoardView>& views,
                                                                    const Board& board, cv::Size size,
                                                                    const CalibrationOptions& options = {});

/// Two views of the same board at the same time.
struct ViewPair {
  BoardView left, right;
};

/// Calibrates a stereo pair: each camera alone, then both and their relative pose together. Errors as above,
/// with the camera named, and an uncertain baseline.
[[nodiscard]] tl::expected<StereoFit, std::string> calibrate_stereo(const std::vector<ViewPair>& pairs,
                                                                    const Board& board, cv::Size size,
                                                                    const CalibrationOptions& options = {});

}  // namespace twofold
