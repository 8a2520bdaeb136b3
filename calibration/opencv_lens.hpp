#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "calibration/calibrate.hpp"

namespace twofold {

// k3 is left at 0: with ordinary lenses and views it only trades against k1 and k2.
inline constexpr int kCalibrationFlags = 1 << 7;  // cv::CALIB_FIX_K3
/// Of the calls that solve; OpenCV's own default stops early.
inline const cv::TermCriteria kUntilSettled(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-10);

/// OpenCV's form of a camera: focal lengths and principal point; k1 k2 p1 p2 k3.
struct Lens {
  cv::Mat K = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat distortion = cv::Mat::zeros(5, 1, CV_64F);
};
[[nodiscard]] CameraModel model_of(const Lens& lens, cv::Size size);

/// Where the corners are on the board [m].
[[nodiscard]] std::vector<cv::Point3f> board_points(const Board& board, const std::vector<int>& ids);

/// @param rotation, translation  board to camera, OpenCV's rotation vector
[[nodiscard]] ViewResiduals residuals_of(const std::vector<cv::Point3f>& points,
                                         const std::vector<cv::Point2f>& pixels, const cv::Mat& rotation,
                                         const cv::Mat& translation, const Lens& lens);
/// Of all corners, one length each [px]; 0 for none.
[[nodiscard]] double rms_of(const std::vector<ViewResiduals>& views);

}  // namespace twofold
