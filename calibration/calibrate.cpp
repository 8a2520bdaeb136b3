#include "calibration/calibrate.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/calib3d.hpp>

#include <fmt/format.h>

#include "calibration/view_shape.hpp"

namespace twofold {
namespace {

// k3 is left at 0: with ordinary lenses and views it only trades against k1 and k2.
constexpr int kFlags = cv::CALIB_FIX_K3;
const cv::TermCriteria kUntilSettled(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-10);

using Points3 = std::vector<cv::Point3f>;
using Points2 = std::vector<cv::Point2f>;

/// OpenCV's form of a camera.
struct Lens {
  cv::Mat K = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat distortion = cv::Mat::zeros(5, 1, CV_64F);
};

Points3 board_points(const Board& board, const std::vector<int>& ids) {
  Points3 points;
  for (const int id : ids) points.push_back(board.corner(id));
  return points;
}

CameraModel model_of(const Lens& lens, cv::Size size) {
  CameraModel model;
  model.pinhole = {lens.K.at<double>(0, 0),
                   lens.K.at<double>(1, 1),
                   lens.K.at<double>(0, 2),
                   lens.K.at<double>(1, 2),
                   size.width,
                   size.height};
  model.distortion.model = DistortionModel::kRadTan;
  for (int i = 0; i < 5; ++i)
    model.distortion.coefficients[static_cast<std::size_t>(i)] = lens.distortion.at<double>(i);
  return model;
}

ViewResiduals residuals_of(const Points3& points, const Points2& pixels, const cv::Mat& rotation,
                           const cv::Mat& translation, const Lens& lens) {
  Points2 projected;
  cv::projectPoints(points, rotation, translation, lens.K, lens.distortion, projected);
  ViewResiduals view{pixels, {}};
  for (std::size_t i = 0; i < pixels.size(); ++i) view.residuals.push_back(pixels[i] - projected[i]);
  return view;
}

double rms_of(const std::vector<ViewResiduals>& views) {
  double sum = 0;
  std::size_t count = 0;
  for (const ViewResiduals& view : views) {
    for (const cv::Point2f& r : view.residuals) sum += r.dot(r);
    count += view.residuals.size();
  }
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(count, 1)));
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// What can be said before anything is solved; empty when nothing speaks against it.
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

std::string refusal_of_error(double rms_px, const CalibrationOptions& options) {
  if (rms_px <= options.max_rms_px) return "";
  return fmt::format(
      "high reprojection error: {:.2f} px, {:.2f} is the most; is the board flat, are its size and "
      "the lens model right, are the images sharp?",
      rms_px, options.max_rms_px);
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
  if (const auto reason = fit.model.distortion.invalid_reason(); !reason.empty()) return reason;
  return "";
}

/// Solves with the views `used`; fills everything but the coverage.
struct Solved {
  CameraFit fit;
  Lens lens;
  std::vector<double> view_errors;  // [px], one a used view
  std::vector<ViewShape> shapes;    // likewise; only the normals
};

Solved solve_camera(const std::vector<BoardView>& views, const Board& board, cv::Size size,
                    std::vector<int> used) {
  std::vector<Points3> points;
  std::vector<Points2> pixels;
  for (const int v : used) {
    points.push_back(board_points(board, views[static_cast<std::size_t>(v)].ids));
    pixels.push_back(views[static_cast<std::size_t>(v)].pixels);
  }
  Solved solved;
  std::vector<cv::Mat> rotations, translations;
  cv::Mat deviations, unused, errors;
  cv::calibrateCamera(points, pixels, size, solved.lens.K, solved.lens.distortion, rotations, translations,
                      deviations, unused, errors, kFlags, kUntilSettled);
  CameraFit& fit = solved.fit;
  fit.model = model_of(solved.lens, size);
  fit.fx_std = deviations.at<double>(0);
  fit.fy_std = deviations.at<double>(1);
  fit.cx_std = deviations.at<double>(2);
  fit.cy_std = deviations.at<double>(3);
  for (std::size_t i = 0; i < points.size(); ++i)
    fit.residuals.push_back(residuals_of(points[i], pixels[i], rotations[i], translations[i], solved.lens));
  for (const cv::Mat& rotation : rotations) {
    cv::Matx33d R;
    cv::Rodrigues(rotation, R);
    solved.shapes.push_back({{R(0, 2), R(1, 2), R(2, 2)}, 0});
  }
  for (const ViewResiduals& view : fit.residuals) solved.view_errors.push_back(rms_of({view}));
  fit.rms_px = rms_of(fit.residuals);
  fit.used = std::move(used);
  return solved;
}

/// The views whose error is not far above the others': a moved or half hidden board spoils few of them.
std::vector<int> without_outliers(const std::vector<int>& used, const std::vector<double>& errors,
                                  double factor) {
  const double limit = factor > 0 ? factor * median(errors) : 1e9;
  std::vector<int> kept;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (errors[i] <= limit) kept.push_back(used[i]);
  }
  return kept;
}

std::vector<int> all_of(std::size_t count) {
  std::vector<int> indices(count);
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

tl::expected<Solved, std::string> calibrate_alone(const std::vector<BoardView>& views, const Board& board,
                                                  cv::Size size, const CalibrationOptions& options) {
  if (auto reason = refusal_of_views(views, size, options); !reason.empty())
    return tl::make_unexpected(std::move(reason));
  try {
    Solved solved = solve_camera(views, board, size, all_of(views.size()));
    const auto kept = without_outliers(solved.fit.used, solved.view_errors, options.outlier);
    if (kept.size() < solved.fit.used.size() && static_cast<int>(kept.size()) >= options.min_views)
      solved = solve_camera(views, board, size, kept);
    Coverage coverage;
    for (const int v : solved.fit.used) coverage.add(views[static_cast<std::size_t>(v)], size);
    solved.fit.coverage = coverage.share();
    if (auto reason = refusal_of_tilts(solved.shapes, options); !reason.empty())
      return tl::make_unexpected(std::move(reason));
    if (auto reason = refusal_of_fit(solved.fit, options); !reason.empty())
      return tl::make_unexpected(std::move(reason));
    return solved;
  } catch (const cv::Exception&) {
    return tl::make_unexpected(std::string("degenerate: no camera explains these views"));
  }
}

/// The corners both images of the pairs show.
struct CommonCorners {
  std::vector<Points3> points;
  std::vector<Points2> left, right;
  std::vector<int> used;
};

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
    if (ids.size() < 8) continue;
    common.points.push_back(board_points(board, ids));
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

tl::expected<CameraFit, std::string> calibrate_camera(const std::vector<BoardView>& views, const Board& board,
                                                      cv::Size size, const CalibrationOptions& options) {
  return calibrate_alone(views, board, size, options).map([](Solved&& solved) {
    return std::move(solved.fit);
  });
}

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
                          kFlags | cv::CALIB_USE_INTRINSIC_GUESS, kUntilSettled);
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
  if (!(fit.baseline_std <= options.max_baseline_std * baseline)) {
    return tl::make_unexpected(
        fmt::format("baseline uncertain: {:.4f} m, standard deviation {:.2f} %, {:.2f} % is the "
                    "most; more views, nearer to the cameras",
                    baseline, 100 * fit.baseline_std / baseline, 100 * options.max_baseline_std));
  }
  if (auto reason = fit.calibration.invalid_reason(); !reason.empty())
    return tl::make_unexpected(std::move(reason));
  return fit;
}

}  // namespace twofold
