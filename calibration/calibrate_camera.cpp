#include <numeric>
#include <opencv2/calib3d.hpp>
#include <span>

#include "base/check.hpp"
#include "base/median.hpp"
#include "calibration/calibrate_alone.hpp"
#include "calibration/refusal.hpp"

namespace twofold {
namespace {

/// Solves with the views `used`; fills everything but the coverage.
struct Solved {
  CameraFit fit;
  Lens lens;
  std::vector<double> view_errors;  // [px], one a used view
  std::vector<ViewShape> shapes;    // likewise; only the normals
};

Solved solve_camera(const std::vector<BoardView>& views, const Board& board, cv::Size size,
                    std::vector<int> used) {
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const int v : used) {
    points.push_back(board_points(board, views[static_cast<std::size_t>(v)].ids));
    pixels.push_back(views[static_cast<std::size_t>(v)].pixels);
  }
  Solved solved;
  std::vector<cv::Mat> rotations, translations;
  cv::Mat deviations, unused, errors;
  cv::calibrateCamera(points, pixels, size, solved.lens.K, solved.lens.distortion, rotations, translations,
                      deviations, unused, errors, kCalibrationFlags, kUntilSettled);
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
  std::vector<double> by_size = errors;
  const double limit = factor > 0 ? factor * median(std::span(by_size)) : 1e9;
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

}  // namespace

tl::expected<AloneFit, std::string> calibrate_alone(const std::vector<BoardView>& views, const Board& board,
                                                    cv::Size size, const CalibrationOptions& options) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "calibration options");
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
    return AloneFit{std::move(solved.fit), solved.lens};
  } catch (const cv::Exception&) {
    return tl::make_unexpected(std::string("degenerate: no camera explains these views"));
  }
}

tl::expected<CameraFit, std::string> calibrate_camera(const std::vector<BoardView>& views, const Board& board,
                                                      cv::Size size, const CalibrationOptions& options) {
  return calibrate_alone(views, board, size, options).map([](AloneFit&& alone) {
    return std::move(alone.fit);
  });
}

}  // namespace twofold
