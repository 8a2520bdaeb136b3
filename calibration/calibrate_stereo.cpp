#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/calib3d.hpp>

#include <fmt/format.h>

#include "calibration/calibrate_alone.hpp"
#include "calibration/refusal.hpp"

namespace twofold {
namespace {

using Points3 = std::vector<cv::Point3f>;
using Points2 = std::vector<cv::Point2f>;

/// The corners both images of the pairs show.
struct CommonCorners {
  std::vector<Points3> points;
  std::vector<Points2> left, right;
  std::vector<int> used;
};

/// Corners in one line leave the board free to turn about it.
bool in_one_line(const std::vector<cv::Point3f>& points) {
  const auto of = [&](const cv::Point3f& p) { return p - points.front(); };
  const auto longest = std::max_element(points.begin(), points.end(), [&](const auto& a, const auto& b) {
    return of(a).dot(of(a)) < of(b).dot(of(b));
  });
  const cv::Point3f line = of(*longest);
  return std::all_of(points.begin(), points.end(), [&](const cv::Point3f& p) {
    return cv::norm(of(p).cross(line)) < 1e-3 * line.dot(line);
  });
}

CommonCorners common_corners(const std::vector<ViewPair>& pairs, const Board& board,
                             const std::vector<int>& used) {
  CommonCorners common;
  for (const int v : used) {
    const ViewPair& pair = pairs[static_cast<std::size_t>(v)];
    std::vector<int> ids;
    Points2 left, right;
    for (std::size_t i = 0; i < pair.left.ids.size(); ++i) {
      const auto at = std::lower_bound(pair.right.ids.begin(), pair.right.ids.end(), pair.left.ids[i]);
      if (at == pair.right.ids.end() || *at != pair.left.ids[i]) continue;
      ids.push_back(*at);
      left.push_back(pair.left.pixels[i]);
      right.push_back(pair.right.pixels[static_cast<std::size_t>(at - pair.right.ids.begin())]);
    }
    std::vector<cv::Point3f> points = board_points(board, ids);
    if (ids.size() < 8 || in_one_line(points)) continue;
    common.points.push_back(std::move(points));
    common.left.push_back(std::move(left));
    common.right.push_back(std::move(right));
    common.used.push_back(v);
  }
  return common;
}

/// Standard deviation of the mean of the baselines that the pairs give one by one.
double baseline_deviation(const CommonCorners& common, const Lens& left, const Lens& right) {
  std::vector<double> baselines;
  for (std::size_t i = 0; i < common.points.size(); ++i) {
    cv::Vec3d r_l, t_l, r_r, t_r;
    cv::solvePnP(common.points[i], common.left[i], left.K, left.distortion, r_l, t_l);
    cv::solvePnP(common.points[i], common.right[i], right.K, right.distortion, r_r, t_r);
    cv::Matx33d R_l, R_r;
    cv::Rodrigues(r_l, R_l);
    cv::Rodrigues(r_r, R_r);
    baselines.push_back(cv::norm(t_r - R_r * R_l.t() * t_l));
  }
  const double n = static_cast<double>(baselines.size());
  const double mean = std::accumulate(baselines.begin(), baselines.end(), 0.0) / n;
  double squares = 0;
  for (const double b : baselines) squares += (b - mean) * (b - mean);
  return std::sqrt(squares / (n * (n - 1)));
}

/// Residuals of both cameras with each board where the left one sees it: the right ones hold that pose's
/// small error, too.
void set_residuals(const CommonCorners& common, const cv::Mat& R, const cv::Mat& t, const Lens& left,
                   const Lens& right, StereoFit* fit) {
  fit->left.residuals.clear();
  fit->right.residuals.clear();
  cv::Mat turn;
  cv::Rodrigues(R, turn);
  for (std::size_t i = 0; i < common.points.size(); ++i) {
    cv::Mat r_left, t_left, r_right, t_right;
    cv::solvePnP(common.points[i], common.left[i], left.K, left.distortion, r_left, t_left);
    cv::composeRT(r_left, t_left, turn, t, r_right, t_right);
    fit->left.residuals.push_back(residuals_of(common.points[i], common.left[i], r_left, t_left, left));
    fit->right.residuals.push_back(residuals_of(common.points[i], common.right[i], r_right, t_right, right));
  }
  fit->left.rms_px = rms_of(fit->left.residuals);
  fit->right.rms_px = rms_of(fit->right.residuals);
}

SE3 rigid_motion(const cv::Mat& R, const cv::Mat& t) {
  Matrix3 rotation;
  Vector3 translation;
  for (int i = 0; i < 3; ++i) {
    translation[i] = t.at<double>(i);
    for (int j = 0; j < 3; ++j) rotation(i, j) = R.at<double>(i, j);
  }
  return SE3(SO3(rotation), translation);
}

}  // namespace

tl::expected<StereoFit, std::string> calibrate_stereo(const std::vector<ViewPair>& pairs, const Board& board,
                                                      cv::Size size, const CalibrationOptions& options) {
  std::vector<BoardView> left_views, right_views;
  for (const ViewPair& pair : pairs) {
    left_views.push_back(pair.left);
    right_views.push_back(pair.right);
  }
  auto left = calibrate_alone(left_views, board, size, options);
  if (!left) return tl::make_unexpected("left camera: " + left.error());
  auto right = calibrate_alone(right_views, board, size, options);
  if (!right) return tl::make_unexpected("right camera: " + right.error());
  std::vector<int> both;
  std::set_intersection(left->fit.used.begin(), left->fit.used.end(), right->fit.used.begin(),
                        right->fit.used.end(), std::back_inserter(both));
  const CommonCorners common = common_corners(pairs, board, both);
  if (static_cast<int>(common.points.size()) < options.min_views) {
    return tl::make_unexpected(
        fmt::format("too few views: only {} pairs show the same corners in both images, {} are "
                    "needed",
                    common.points.size(), options.min_views));
  }
  cv::Mat R, t, E, F, errors;
  const double rms_px =
      cv::stereoCalibrate(common.points, common.left, common.right, left->lens.K, left->lens.distortion,
                          right->lens.K, right->lens.distortion, size, R, t, E, F, errors,
                          kCalibrationFlags | cv::CALIB_USE_INTRINSIC_GUESS, kUntilSettled);
  StereoFit fit{{}, left->fit, right->fit, rms_px, 0};
  fit.left.used = fit.right.used = common.used;
  set_residuals(common, R, t, left->lens, right->lens, &fit);
  fit.left.model = fit.calibration.left = model_of(left->lens, size);
  fit.right.model = fit.calibration.right = model_of(right->lens, size);
  fit.calibration.T_right_left = rigid_motion(R, t);
  fit.baseline_std = baseline_deviation(common, left->lens, right->lens);
  if (auto reason = refusal_of_error(fit.rms_px, options); !reason.empty())
    return tl::make_unexpected("both cameras together: " + reason +
                               " Do both take their images at the same time?");
  const double baseline = fit.calibration.T_right_left.translation().norm();
  if (auto reason = refusal_of_baseline(baseline, fit.baseline_std, options); !reason.empty())
    return tl::make_unexpected(std::move(reason));
  if (auto reason = fit.calibration.invalid_reason(); !reason.empty())
    return tl::make_unexpected(std::move(reason));
  return fit;
}

}  // namespace twofold
