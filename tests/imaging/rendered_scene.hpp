#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <random>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold::testing {

/// Smooth random texture: octaves of value noise with known, sharp and broad detail. Grey in [0, 255].
class NoiseTexture {
 public:
  explicit NoiseTexture(std::uint32_t seed) {
    std::mt19937 random(seed);
    for (float& value : lattice_) value = std::uniform_real_distribution<float>(-1, 1)(random);
  }

  /// @param finest  size of the smallest cell, in the units of x and y
  [[nodiscard]] double operator()(double x, double y, double finest) const {
    double sum = 0;
    double size = finest;
    for (int octave = 0; octave < 5; ++octave, size *= 2.3) {
      sum += octave_value(x / size + 17.3 * octave, y / size + 5.1 * octave);
    }
    return std::clamp(128.0 + 62.0 * sum, 0.0, 255.0);
  }

 private:
  static constexpr int kSide = 256;

  [[nodiscard]] double at(int x, int y) const {
    return lattice_[static_cast<std::size_t>((y & (kSide - 1)) * kSide + (x & (kSide - 1)))];
  }
  [[nodiscard]] double octave_value(double x, double y) const {
    const double fx = std::floor(x);
    const double fy = std::floor(y);
    const int i = static_cast<int>(fx);
    const int j = static_cast<int>(fy);
    const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
    const double a = smooth(x - fx);
    const double b = smooth(y - fy);
    return (1 - b) * ((1 - a) * at(i, j) + a * at(i + 1, j)) +
           b * ((1 - a) * at(i, j + 1) + a * at(i + 1, j + 1));
  }

  std::array<float, static_cast<std::size_t>(kSide) * kSide> lattice_{};
};

/// A room seen from inside: an axis-parallel box [m] whose six walls carry noise. Rendered by casting rays,
/// several a pixel, so that geometry and image are exact up to sensor noise and rounding.
class RenderedScene {
 public:
  RenderedScene(const Rig& rig, const Vector3& half_size, std::uint32_t seed)
      : rig_(rig), half_size_(half_size), texture_(seed), random_(seed + 1) {}

  /// Depth along the camera's axis of the surface seen at a level-0 pixel [m].
  [[nodiscard]] double depth(const SE3& T_c_w, const Vector2& uv) const {
    return hit(T_c_w.inverse(), rig_.camera.unproject(uv)).distance;
  }

  /// Stereo pair or left image and depth, as the rig has it, with pyramids.
  void render(const SE3& T_c_w, double noise_sigma, FrameImages& images) {
    images.left.build(render_one(T_c_w, noise_sigma));
    if (rig_.kind == SensorKind::kStereo) {
      const SE3 T_r_c = SE3(SO3(), Vector3(-rig_.baseline, 0, 0));
      images.right.build(render_one(T_r_c * T_c_w, noise_sigma));
    }
    if (rig_.kind == SensorKind::kRgbd) images.depth = render_depth(T_c_w);
  }

  [[nodiscard]] cv::Mat render_one(const SE3& T_c_w, double noise_sigma) {
    const PinholeCamera& camera = rig_.camera;
    const SE3 T_w_c = T_c_w.inverse();
    cv::Mat image(camera.height, camera.width, CV_8UC1);
    std::normal_distribution<double> noise(0, noise_sigma);
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        double sum = 0;
        for (int s = 0; s < kSamples * kSamples; ++s) {
          const Vector2 inside((s % kSamples + 0.5) / kSamples - 0.5, (s / kSamples + 0.5) / kSamples - 0.5);
          sum += value(hit(T_w_c, camera.unproject(Vector2(u, v) + inside)));
        }
        const double grey = sum / (kSamples * kSamples) + (noise_sigma > 0 ? noise(random_) : 0.0);
        image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(std::clamp(grey + 0.5, 0.0, 255.0));
      }
    }
    return image;
  }

  [[nodiscard]] cv::Mat render_depth(const SE3& T_c_w) const {
    const SE3 T_w_c = T_c_w.inverse();
    cv::Mat image(rig_.camera.height, rig_.camera.width, CV_16UC1);
    for (int v = 0; v < image.rows; ++v) {
      for (int u = 0; u < image.cols; ++u) {
        const double metres = hit(T_w_c, rig_.camera.unproject(Vector2(u, v))).distance;
        image.at<std::uint16_t>(v, u) = static_cast<std::uint16_t>(metres / rig_.depth_unit + 0.5);
      }
    }
    return image;
  }

 private:
  static constexpr int kSamples = 3;
  struct Hit {
    double distance = 0;
    int wall = 0;
    Vector3 x_w{0, 0, 0};
  };

  /// First wall met from inside the box; the ray has depth 1, so its length counts in depths.
  [[nodiscard]] Hit hit(const SE3& T_w_c, const Vector3& ray_c) const {
    const Vector3 origin = T_w_c.translation();
    const Vector3 ray = T_w_c.rotation() * ray_c;
    Hit nearest;
    nearest.distance = 1e9;
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(ray[axis]) < 1e-12) continue;
      const double wall = ray[axis] > 0 ? half_size_[axis] : -half_size_[axis];
      const double distance = (wall - origin[axis]) / ray[axis];
      if (distance < nearest.distance)
        nearest = {distance, 2 * axis + (ray[axis] > 0), origin + distance * ray};
    }
    return nearest;
  }
  [[nodiscard]] double value(const Hit& hit) const {
    const int axis = hit.wall / 2;
    const double x = hit.x_w[(axis + 1) % 3] + 31.7 * hit.wall;
    const double y = hit.x_w[(axis + 2) % 3] + 11.9 * hit.wall;
    return texture_(x, y, kFinest);
  }

  static constexpr double kFinest = 0.03;  ///< finest detail of the walls [m]

  Rig rig_;
  Vector3 half_size_;
  NoiseTexture texture_;
  std::mt19937 random_;
};

inline Rig test_rig(SensorKind kind, int width = 640, int height = 480) {
  Rig rig;
  rig.kind = kind;
  rig.camera = {0.8 * width, 0.8 * width, 0.5 * width - 0.3, 0.5 * height + 0.2, width, height};
  rig.baseline = 0.12;
  return rig;
}

}  // namespace twofold::testing
