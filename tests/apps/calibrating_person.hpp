#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <utility>

#include "fixtures/rendered_board.hpp"

namespace twofold::testing {

inline constexpr int kWidth = 640, kHeight = 480;
inline const CameraModel kLeft = test_camera(460, 324.3, 237.1, -0.28, 0.074, 0.0002, -0.0004);
inline const CameraModel kRight = test_camera(457, 315.6, 243.8, -0.27, 0.069, -0.0003, 0.0003);
inline const SE3 kT_right_left(SO3::exp(Vector3(0.004, -0.012, 0.006)), Vector3(-0.06, 0.0011, -0.0007));

/// The cameras, made once: each undistorts 300,000 rays.
inline const BoardCamera& left_camera() {
  static const BoardCamera camera(kLeft);
  return camera;
}
inline const BoardCamera& right_camera() {
  static const BoardCamera camera(kRight);
  return camera;
}

inline bool both_see(const SE3& T_l_b) {
  return sees(kLeft, kBoard, T_l_b) && sees(kRight, kBoard, kT_right_left * T_l_b);
}

/// How somebody holds the board: where in the image, how far away, how turned.
struct Hold {
  double x = 0, y = 0;        // of its middle in the image, -1 left/top .. 1 right/bottom
  double distance = 0.45;     // [m]
  double yaw = 0, pitch = 0;  // [rad]: right, lower side away

  /// The pose nearest to it, towards the middle of the image, in which both cameras see the board.
  [[nodiscard]] SE3 T_l_b() const {
    const SO3 R = SO3::exp(Vector3(pitch, -yaw, 0));
    const Vector3 middle_b(0.1, 0.0625, 0);
    for (double share = 1; share > 0; share -= 0.02) {
      const Vector3 centre(0.75 * distance * share * x, 0.55 * distance * share * y, distance);
      const SE3 T(R, centre - R.matrix() * middle_b);
      if (both_see(T)) return T;
    }
    return SE3(R, Vector3(0, 0, distance) - R.matrix() * middle_b);
  }
};

/// Does what the last line said.
class ObedientPerson {
 public:
  void hear(const std::string& line) { heard_ = line; }

  Hold next() {
    const auto told = [&](const char* part) { return heard_.find(part) != std::string::npos; };
    std::uniform_real_distribution<double> unit(-1, 1);
    Hold hold;
    hold.distance = 0.42 + 0.05 * unit(random_);
    if (told("show the board in the")) {
      hold.x = told("left") ? -1 : told("right") ? 1 : 0;
      hold.y = told("upper") ? -1 : told("lower") ? 1 : 0;
      hold.x += 0.15 * unit(random_);
      hold.y += 0.15 * unit(random_);
    } else if (told("tilt its")) {
      hold.yaw = told("right side") ? 0.5 : told("left side") ? -0.5 : 0;
      hold.pitch = told("lower side") ? 0.5 : told("upper side") ? -0.5 : 0;
    } else if (told("nearer") || told("farther")) {
      // More and more, as long as it is asked for.
      asked_again_ = heard_ == asked_ ? asked_again_ + 1 : 0;
      asked_ = heard_;
      hold.distance = told("nearer") ? std::max(0.36 - 0.03 * asked_again_, 0.24) : 0.6 + 0.05 * asked_again_;
    } else {
      hold = {unit(random_), unit(random_), 0.5 + 0.1 * unit(random_), 0.5 * unit(random_),
              0.5 * unit(random_)};
    }
    return hold;
  }

 private:
  std::string heard_, asked_;
  int asked_again_ = 0;
  std::mt19937 random_{6};
};

/// What one camera sees; each hold lasts kFramesAHold frames.
class Scene {
 public:
  static constexpr std::uint64_t kFramesAHold = 3;
  using Holder = std::function<SE3(std::uint64_t hold)>;  // T_l_b

  /// `camera` must outlive the scene.
  Scene(const BoardCamera& camera, SE3 T_c_l, Holder holder)
      : camera_(camera), T_c_l_(T_c_l), holder_(std::move(holder)) {}

  const cv::Mat& image(std::uint64_t frame) {
    const std::uint64_t hold = frame / kFramesAHold;
    if (image_.empty() || hold != hold_) {
      hold_ = hold;
      std::mt19937 noise(static_cast<unsigned>(hold));
      image_ = camera_.see(print_, kPrintSquarePx / kBoard.square,
                           {2.0 * kPrintSquarePx, 2.0 * kPrintSquarePx}, T_c_l_ * holder_(hold), noise);
    }
    return image_;
  }

 private:
  const BoardCamera& camera_;
  SE3 T_c_l_;
  Holder holder_;
  cv::Mat print_ = print_chessboard(kBoard);
  cv::Mat image_;
  std::uint64_t hold_ = 0;
};

}  // namespace twofold::testing
