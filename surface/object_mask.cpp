#include "surface/object_mask.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <utility>

#include <fmt/format.h>

#include "base/check.hpp"
#include "base/option_check.hpp"

namespace twofold {
namespace {

constexpr int kStep = 4;                   // pixels between the points that the plane is found with
constexpr int kTrials = 300;               // random triples
constexpr double kLeastShare = 0.15;       // of the near points: on the plane
constexpr double kUpperShare = 0.25;       // of the plane's points: on another one above it
constexpr std::size_t kLeastPoints = 200;  // near enough, to say anything
constexpr double kLeastObject = 0.002;     // of the image: a mask smaller than this is nothing
constexpr double kPieceShare = 0.1;        // of the largest piece: smaller ones are specks
constexpr double kLeastWithin = 0.002;     // [m] a point of the plane may be from it

}  // namespace

std::string ObjectMaskOptions::invalid_reason() const {
  return OptionCheck()
      .above("farthest", farthest, 0)
      .at_least("above", above, 0)
      .within("erode", erode, 0, 20)
      .above("depth_noise", depth_noise, 0)
      .reason();
}

ObjectMasker::ObjectMasker(const Rig& rig, const ObjectMaskOptions& options) : rig_(rig), options_(options) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "valid options");
}

double ObjectMasker::within(double z) const {
  return std::max(kLeastWithin, 3 * options_.depth_noise * z * z);
}

std::vector<Vector3> ObjectMasker::near_points(const cv::Mat& depth) const {
  std::vector<Vector3> points;
  for (int y = 0; y < depth.rows; y += kStep) {
    const auto* row = depth.ptr<std::uint16_t>(y);
    for (int x = 0; x < depth.cols; x += kStep) {
      const double z = rig_.depth_unit * row[x];
      if (z >= rig_.depth_min && z <= options_.farthest)
        points.emplace_back(rig_.camera.unproject(Vector2(x, y)) * z);
    }
  }
  return points;
}

std::vector<Vector3> ObjectMasker::on_plane(const std::vector<Vector3>& points,
                                            const SupportPlane& plane) const {
  std::vector<Vector3> on;
  for (const Vector3& x : points)
    if (std::abs(plane.height(x)) < within(x.z())) on.push_back(x);
  return on;
}

/// Least squares over the points on it; false when these are too few.
bool ObjectMasker::refine(const std::vector<Vector3>& points, SupportPlane& plane) const {
  for (int round = 0; round < 3; ++round) {
    const std::vector<Vector3> on = on_plane(points, plane);
    if (static_cast<double>(on.size()) < kLeastShare * static_cast<double>(points.size()) || on.size() < 3)
      return false;
    Vector3 mean = Vector3::Zero();
    for (const Vector3& x : on) mean += x;
    mean /= static_cast<double>(on.size());
    Matrix3 scatter = Matrix3::Zero();
    for (const Vector3& x : on) scatter += (x - mean) * (x - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Matrix3> solver(scatter);
    plane.normal = solver.eigenvectors().col(0);
    plane.offset = -plane.normal.dot(mean);
    if (plane.offset < 0) {  // the camera, at the origin, is on the upper side
      plane.normal = -plane.normal;
      plane.offset = -plane.offset;
    }
  }
  return true;
}

/// The plane through three random points that most lie on  (Fischler and Bolles, CACM 1981).
bool ObjectMasker::search(const std::vector<Vector3>& points, SupportPlane& plane) const {
  std::mt19937 random(1);
  const auto any = [&]() -> const Vector3& { return points[random() % points.size()]; };
  std::size_t most = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Vector3 &a = any(), &b = any(), &c = any();
    const Vector3 across = (b - a).cross(c - a);
    if (across.norm() < 1e-4) continue;  // [m^2]: they lie on a line, or beside each other
    SupportPlane candidate;
    candidate.normal = across.normalized();
    if (candidate.normal.dot(a) > 0) candidate.normal = -candidate.normal;
    candidate.offset = -candidate.normal.dot(a);
    std::size_t on = 0;
    for (std::size_t i = 0; i < points.size(); i += 3)
      on += std::abs(candidate.height(points[i])) < within(points[i].z());
    if (on <= most) continue;
    most = on;
    plane = candidate;
  }
  return most > 0 && refine(points, plane);
}

/// Onto the highest plane beside this one that still has its share of points: the plate on a table, but not
/// the lid of what stands on it.
void ObjectMasker::raise(const std::vector<Vector3>& points, SupportPlane& plane) const {
  constexpr double kBin = 0.002, kHighest = 0.15;  // [m]
  std::vector<int> count(static_cast<std::size_t>(kHighest / kBin), 0);
  for (const Vector3& x : points) {
    const double h = plane.height(x);
    if (h > within(x.z()) && h < kHighest - kBin) ++count[static_cast<std::size_t>(h / kBin)];
  }
  const auto least = kUpperShare * static_cast<double>(on_plane(points, plane).size());
  for (std::size_t b = count.size() - 1; b > 1; --b) {
    if (count[b - 1] + count[b] + count[b - 2] < least) continue;
    SupportPlane upper = plane;
    upper.offset -= (static_cast<double>(b) - 0.5) * kBin;
    if (refine(points, upper)) plane = upper;
    return;
  }
}

std::string ObjectMasker::find_plane(const cv::Mat& depth) {
  const std::vector<Vector3> points = near_points(depth);
  if (points.size() < kLeastPoints)
    return fmt::format("hardly any depth between {:g} and {:g} m", rig_.depth_min, options_.farthest);
  SupportPlane plane = plane_;
  if (!has_plane_ || !refine(points, plane)) {
    if (!search(points, plane)) return "no plane that an object could stand on";
    raise(points, plane);
  }
  plane_ = plane;
  has_plane_ = true;
  return {};
}

cv::Mat ObjectMasker::candidates(const cv::Mat& depth) const {
  cv::Mat mask(depth.size(), CV_8UC1, cv::Scalar(0));
  for (int y = 0; y < depth.rows; ++y) {
    const auto* row = depth.ptr<std::uint16_t>(y);
    for (int x = 0; x < depth.cols; ++x) {
      const double z = rig_.depth_unit * row[x];
      if (z < rig_.depth_min || z > options_.farthest) continue;
      const double height = plane_.height(rig_.camera.unproject(Vector2(x, y)) * z);
      if (options_.held || height > std::max(options_.above, 4 * options_.depth_noise * z * z))
        mask.at<std::uint8_t>(y, x) = 255;
    }
  }
  return mask;
}

tl::expected<cv::Mat, std::string> ObjectMasker::mask(const cv::Mat& depth) {
  TWOFOLD_CHECK(
      depth.type() == CV_16UC1 && depth.cols == rig_.camera.width && depth.rows == rig_.camera.height,
      "a depth image of the rig");
  if (!options_.held)
    if (std::string missing = find_plane(depth); !missing.empty()) return tl::unexpected(std::move(missing));
  cv::Mat near = candidates(depth);
  // Specks of noise go; then all pieces but the large ones.
  cv::morphologyEx(near, near, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8UC1));
  cv::Mat label, size, centre;
  const int pieces = cv::connectedComponentsWithStats(near, label, size, centre);
  int largest = 0;
  for (int n = 1; n < pieces; ++n) largest = std::max(largest, size.at<int>(n, cv::CC_STAT_AREA));
  if (largest < kLeastObject * static_cast<double>(depth.total()))
    return tl::unexpected(std::string(options_.held ? "nothing near enough holds together"
                                                    : "nothing is left above the support plane"));
  cv::Mat object(depth.size(), CV_8UC1, cv::Scalar(0));
  for (int n = 1; n < pieces; ++n)
    if (size.at<int>(n, cv::CC_STAT_AREA) >= kPieceShare * largest) object.setTo(255, label == n);
  if (options_.erode > 0) {
    const int edge = 2 * options_.erode + 1;
    cv::erode(object, object, cv::Mat::ones(edge, edge, CV_8UC1), {-1, -1}, 1, cv::BORDER_CONSTANT, 0);
  }
  if (cv::countNonZero(object) == 0)
    return tl::unexpected(std::string("nothing is left of the object once its rim is taken away"));
  return object;
}

cv::Mat fill_outside(const cv::Mat& image, const cv::Mat& mask) {
  if (cv::countNonZero(mask) == 0) return {image.size(), CV_8UC1, cv::Scalar(128)};
  cv::Mat outside, distance, nearest;
  cv::bitwise_not(mask, outside);
  cv::distanceTransform(outside, distance, nearest, cv::DIST_L2, cv::DIST_MASK_5, cv::DIST_LABEL_PIXEL);
  double most = 0;
  cv::minMaxLoc(nearest, nullptr, &most);
  std::vector<std::uint8_t> level(static_cast<std::size_t>(most) + 1, 128);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      if (mask.at<std::uint8_t>(y, x) != 0)
        level[static_cast<std::size_t>(nearest.at<int>(y, x))] = image.at<std::uint8_t>(y, x);
  cv::Mat filled(image.size(), CV_8UC1);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      filled.at<std::uint8_t>(y, x) = level[static_cast<std::size_t>(nearest.at<int>(y, x))];
  constexpr int kSmoothing = 31;  // [px]
  cv::blur(filled, filled, {kSmoothing, kSmoothing});
  image.copyTo(filled, mask);
  return filled;
}

bool reaches_border(const cv::Mat& mask, int erode) {
  const int rim = erode + 1;
  const cv::Rect inner(rim, rim, std::max(0, mask.cols - 2 * rim), std::max(0, mask.rows - 2 * rim));
  return cv::countNonZero(mask(inner)) < cv::countNonZero(mask);
}

cv::Mat mask_in_right(const Rig& rig, const cv::Mat& mask, const cv::Mat& depth) {
  cv::Mat right(mask.size(), CV_8UC1, cv::Scalar(0));
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      const double z = rig.depth_unit * depth.at<std::uint16_t>(y, x);
      if (mask.at<std::uint8_t>(y, x) == 0 || z <= 0) continue;
      const auto u = static_cast<int>(std::lround(x - rig.camera.fx * rig.baseline / z));
      if (u >= 0 && u < mask.cols) right.at<std::uint8_t>(y, u) = 255;
    }
  }
  // Pixels that no other was moved onto, on surfaces seen more squarely from the right.
  cv::morphologyEx(right, right, cv::MORPH_CLOSE, cv::Mat::ones(1, 5, CV_8UC1));
  return right;
}

}  // namespace twofold
