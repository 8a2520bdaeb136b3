#include "camera/depth_registration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "base/check.hpp"

namespace twofold {
namespace {

constexpr float kMaxStepShare = 0.05f;  // of the depth, from pixel to pixel

/// A reading in the image it is registered to.
struct Sight {
  float u = 0, v = 0, z = 0;  ///< [px, px, units of depth]; z = 0: none
};

void keep_nearest(cv::Mat& registered, int u, int v, float z) {
  if (!(z >= 0.5f && z < 65535)) return;
  auto& kept = registered.at<std::uint16_t>(v, u);
  const auto reading = cv::saturate_cast<std::uint16_t>(z);
  if (kept == 0 || reading < kept) kept = reading;
}

void draw_point(cv::Mat& registered, const Sight& s) {
  if (s.z <= 0) return;
  if (!(s.u > -0.5f && s.v > -0.5f && s.u < static_cast<float>(registered.cols) - 0.5f &&
        s.v < static_cast<float>(registered.rows) - 0.5f))
    return;
  keep_nearest(registered, cvRound(s.u), cvRound(s.v), s.z);
}

/// All pixels whose centre lies in a triangle; one that is seen from behind has none.
void draw_triangle(cv::Mat& registered, const Sight& a, const Sight& b, const Sight& c) {
  const float area = (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u);
  if (!(area > 0)) return;
  constexpr float kRim = 1e-3f;  // pixels on an edge belong to both sides
  // Points almost in the camera's own plane are seen farther out than whole numbers reach.
  const auto column = [&](float u) { return std::clamp(u, 0.0f, static_cast<float>(registered.cols)); };
  const auto row = [&](float v) { return std::clamp(v, 0.0f, static_cast<float>(registered.rows)); };
  const int left = static_cast<int>(std::ceil(column(std::min({a.u, b.u, c.u}) - kRim)));
  const int top = static_cast<int>(std::ceil(row(std::min({a.v, b.v, c.v}) - kRim)));
  const int right = std::min(static_cast<int>(column(std::max({a.u, b.u, c.u}) + kRim)), registered.cols - 1);
  const int bottom = std::min(static_cast<int>(row(std::max({a.v, b.v, c.v}) + kRim)), registered.rows - 1);
  for (int v = top; v <= bottom; ++v) {
    for (int u = left; u <= right; ++u) {
      const float x = static_cast<float>(u), y = static_cast<float>(v);
      const float of_c = ((b.u - a.u) * (y - a.v) - (b.v - a.v) * (x - a.u)) / area;
      const float of_b = ((x - a.u) * (c.v - a.v) - (y - a.v) * (c.u - a.u)) / area;
      if (of_b < -kRim || of_c < -kRim || of_b + of_c > 1 + kRim) continue;
      keep_nearest(registered, u, v, a.z + of_b * (b.z - a.z) + of_c * (c.z - a.z));
    }
  }
}

/// The surface between the pixels (x, y), (x + 1, y), (x, y + 1) and (x + 1, y + 1) of the depth image.
void draw_cell(cv::Mat& registered, const std::array<Sight, 4>& corner) {
  float low = corner[0].z, high = corner[0].z;
  for (const Sight& s : corner) {
    low = std::min(low, s.z);
    high = std::max(high, s.z);
  }
  if (low > 0 && high - low <= kMaxStepShare * low) {
    draw_triangle(registered, corner[0], corner[1], corner[2]);
    draw_triangle(registered, corner[3], corner[2], corner[1]);
    return;
  }
  for (const Sight& s : corner) draw_point(registered, s);
}

}  // namespace

DepthRegistration::DepthRegistration(const DepthCamera& camera, const SE3& T_seen_left,
                                     const PinholeCamera& seen, double unit)
    : ray_(camera.model.pinhole.height, camera.model.pinhole.width, CV_32FC3),
      width_(seen.width),
      height_(seen.height) {
  Matrix3 K;
  K << seen.fx, 0, seen.cx, 0, seen.fy, seen.cy, 0, 0, 1;
  const SE3 T_seen_depth = T_seen_left * camera.T_left_depth;
  const Matrix3 A = K * T_seen_depth.rotation();
  const Vector3 shift = K * T_seen_depth.translation() / unit;
  for (int i = 0; i < 3; ++i) shift_[i] = static_cast<float>(shift[i]);
  for (int y = 0; y < ray_.rows; ++y) {
    for (int x = 0; x < ray_.cols; ++x) {
      const auto ray = camera.model.unproject(Vector2(x, y));
      const Vector3 at = ray ? Vector3(A * *ray) : Vector3::Zero();
      for (int i = 0; i < 3; ++i) ray_.at<cv::Vec3f>(y, x)[i] = static_cast<float>(at[i]);
    }
  }
}

void DepthRegistration::apply(const cv::Mat& depth, cv::Mat& registered) const {
  TWOFOLD_CHECK(depth.type() == CV_16UC1 && depth.size() == ray_.size(), "a depth image of the depth camera");
  registered.create(height_, width_, CV_16UC1);
  registered.setTo(0);
  const auto sight = [&](int y, int x) {
    const auto z = static_cast<float>(depth.at<std::uint16_t>(y, x));
    const cv::Vec3f at = ray_.at<cv::Vec3f>(y, x) * z + shift_;
    if (z == 0 || ray_.at<cv::Vec3f>(y, x)[2] <= 0 || !(at[2] > 0)) return Sight{};
    return Sight{at[0] / at[2], at[1] / at[2], at[2]};
  };
  for (int y = 0; y + 1 < depth.rows; ++y) {
    std::array<Sight, 4> corner{Sight{}, sight(y, 0), Sight{}, sight(y + 1, 0)};
    for (int x = 1; x < depth.cols; ++x) {
      corner = {corner[1], sight(y, x), corner[3], sight(y + 1, x)};
      draw_cell(registered, corner);
    }
  }
}

}  // namespace twofold
