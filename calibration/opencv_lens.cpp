#include "calibration/opencv_lens.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace twofold {

static_assert(kCalibrationFlags == cv::CALIB_FIX_K3);

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

std::vector<cv::Point3f> board_points(const Board& board, const std::vector<int>& ids) {
  std::vector<cv::Point3f> points;
  points.reserve(ids.size());
  for (const int id : ids) points.push_back(board.corner(id));
  return points;
}

ViewResiduals residuals_of(const std::vector<cv::Point3f>& points, const std::vector<cv::Point2f>& pixels,
                           const cv::Mat& rotation, const cv::Mat& translation, const Lens& lens) {
  std::vector<cv::Point2f> projected;
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

}  // namespace twofold
