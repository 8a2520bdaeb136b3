#include "tracking/fixed/image_motion.hpp"

#include <algorithm>

namespace twofold {
namespace {

constexpr double kInView = 0.1;  // of its first depth: nearer, what was seen is at the image's edge or beyond
constexpr int kAttempts = 4;     // to find the nearest depth that is still in view

std::size_t slot(std::int64_t frame) {
  return static_cast<std::size_t>(frame % ImageMotion::kRemembered);
}

/// The point nearest to the origin on the way from a to b.
Vector2 nearest_to_origin(const Vector2& a, const Vector2& b) {
  const Vector2 way = b - a;
  const double length2 = way.squaredNorm();
  if (!(length2 > 0)) return a;
  return a + std::clamp(-a.dot(way) / length2, 0.0, 1.0) * way;
}

}  // namespace

void ImageMotion::advance(const SE3& T_now_before) {
  const SE3 T_now_first = T_now_before * T_frame_first_[slot(frame_)];
  T_frame_first_[slot(++frame_)] = T_now_first;
  then_ = -1;
}

void ImageMotion::restart() {
  first_ = ++frame_;
  T_frame_first_[slot(frame_)] = SE3();
  then_ = -1;
}

void ImageMotion::set_inverse_depths(double least, double most) {
  least_ = least;
  most_ = most;
}

/// With growing inverse depth, a point's projection goes along a straight line, the epipolar one, in one
/// direction: the shortest displacement is where that line comes nearest to the pixel itself.
std::optional<Vector2> ImageMotion::least_since(std::int64_t then, const Vector2& uv) {
  if (then < first_ || frame_ - then >= kRemembered) return std::nullopt;
  if (then != then_) {
    T_now_then_ = T_frame_first_[slot(frame_)] * T_frame_first_[slot(then)].inverse();
    then_ = then;
  }
  const Vector3 ray = T_now_then_.rotation() * camera_.unproject(uv);
  const Vector3& t = T_now_then_.translation();
  const Vector3 far = ray + least_ * t;
  if (far.z() < kInView) return Vector2::Zero();
  double most = most_;
  for (int i = 0; i < kAttempts && ray.z() + most * t.z() < kInView; ++i) most = (most + least_) / 2;
  const Vector3 near = ray + most * t;
  const Vector2 of_far = camera_.project(far) - uv;
  return near.z() < kInView ? of_far : nearest_to_origin(of_far, camera_.project(near) - uv);
}

}  // namespace twofold
