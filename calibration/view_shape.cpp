#include "calibration/view_shape.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <span>

#include "base/median.hpp"

namespace twofold {

double ViewShape::yaw() const {
  return std::atan2(normal[0], -normal[2]);
}

double ViewShape::pitch() const {
  return std::atan2(normal[1], -normal[2]);
}

std::optional<ViewShape> shape_of(const BoardView& view, const Board& board, cv::Size size) {
  std::vector<cv::Point3f> points;
  for (const int id : view.ids) points.push_back(board.corner(id));
  const double f = 0.9 * std::max(size.width, size.height);
  const cv::Matx33d K(f, 0, 0.5 * size.width, 0, f, 0.5 * size.height, 0, 0, 1);
  cv::Vec3d rotation, translation;
  try {
    if (!cv::solvePnP(points, view.pixels, K, cv::noArray(), rotation, translation, false, cv::SOLVEPNP_IPPE))
      return std::nullopt;
  } catch (const cv::Exception&) {  // thrown for corners without a plane
    return std::nullopt;
  }
  cv::Matx33d R;
  cv::Rodrigues(rotation, R);
  ViewShape shape;
  shape.normal = {R(0, 2), R(1, 2), R(2, 2)};
  if (shape.normal[2] > 0) shape.normal = -shape.normal;
  const cv::Rect2f box = cv::boundingRect(view.pixels);
  shape.size =
      std::max(box.width / static_cast<float>(size.width), box.height / static_cast<float>(size.height));
  return shape;
}

int tilted_views(const std::vector<ViewShape>& shapes, double angle) {
  if (shapes.empty()) return 0;
  cv::Vec3d middle;  // by coordinate: one odd view does not move it
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    values.reserve(shapes.size());
    for (const ViewShape& shape : shapes) values.push_back(shape.normal[axis]);
    middle[axis] = median(std::span(values));
  }
  middle = cv::normalize(middle);
  return static_cast<int>(std::count_if(shapes.begin(), shapes.end(), [&](const ViewShape& shape) {
    return std::acos(std::clamp(middle.dot(shape.normal), -1.0, 1.0)) > angle;
  }));
}

void Coverage::add(const BoardView& view, cv::Size size) {
  for (const cv::Point2f& p : view.pixels) {
    const int column =
        std::clamp(static_cast<int>(p.x * kColumns / static_cast<float>(size.width)), 0, kColumns - 1);
    const int row = std::clamp(static_cast<int>(p.y * kRows / static_cast<float>(size.height)), 0, kRows - 1);
    ++corners[static_cast<std::size_t>(row * kColumns + column)];
  }
}

double Coverage::share() const {
  const auto seen = std::count_if(corners.begin(), corners.end(), [](int n) { return n > 0; });
  return static_cast<double>(seen) / static_cast<double>(corners.size());
}

}  // namespace twofold
