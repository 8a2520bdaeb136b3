#pragma once

#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core/mat.hpp>

#include "surface/depth_view.hpp"
#include "surface/volume.hpp"

namespace twofold::testing {

inline Rig depth_rig(int width = 320, int height = 240) {
  Rig rig;
  rig.kind = SensorKind::kRgbd;
  rig.camera = {0.8 * width, 0.8 * width, 0.5 * (width - 1), 0.5 * (height - 1), width, height};
  rig.baseline = 0.1;
  return rig;
}

inline SurfaceOptions fine_options(double voxel = 0.01) {
  SurfaceOptions options;
  options.voxel = voxel;
  options.depth_noise = 1.425e-3;
  options.min_triangles = 0;
  return options;
}

struct Ball {
  Vector3 centre{0, 0, 0};
  double radius = 0.15;
};

/// Exact depth [m], CV_32FC1, of a ball before a wall `wall` metres from the camera (0: nothing).
inline cv::Mat depth_of(const Rig& rig, const SE3& T_c_w, const Ball& ball, double wall = 0) {
  cv::Mat depth(rig.camera.height, rig.camera.width, CV_32FC1);
  const Vector3 centre_c = T_c_w * ball.centre;
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      const Vector3 ray = rig.camera.unproject(Vector2(x, y));
      const double b = ray.dot(centre_c) / ray.squaredNorm();
      const double q = b * b - (centre_c.squaredNorm() - ball.radius * ball.radius) / ray.squaredNorm();
      const double z = q > 0 ? b - std::sqrt(q) : wall;
      depth.at<float>(y, x) = static_cast<float>(z);
    }
  }
  return depth;
}

/// Camera `n` of `count` around the vertical axis z of the world, 0.8 m from the origin, higher and lower in
/// turn.
inline SE3 camera_around(int n, int count) {
  const double angle = 2 * std::numbers::pi * n / count;
  const double up = n % 2 == 0 ? 0.6 : -0.6;
  const Vector3 eye =
      0.8 * Vector3(std::cos(up) * std::cos(angle), std::cos(up) * std::sin(angle), std::sin(up));
  const Vector3 z = -eye.normalized();
  const Vector3 x = z.cross(Vector3::UnitZ()).normalized();
  Matrix3 R_w_c;
  R_w_c << x, z.cross(x), z;
  return SE3(R_w_c, eye).inverse();
}

inline SurfaceVolume volume_of(const Ball& ball, int views = 12, double voxel = 0.01) {
  SurfaceVolume volume(fine_options(voxel));
  const Rig rig = depth_rig();
  for (int n = 0; n < views; ++n) {
    const SE3 T_c_w = camera_around(n, views);
    volume.fuse(make_depth_view(rig, depth_of(rig, T_c_w, ball), {}), T_c_w);
  }
  return volume;
}

}  // namespace twofold::testing
