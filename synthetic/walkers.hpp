#pragma once

#include <cstdint>
#include <vector>

#include "synthetic/camera_path.hpp"
#include "synthetic/scene.hpp"

namespace twofold::synthetic {

/// People around a camera that walks: every other one walks two metres ahead of it for eight seconds, the
/// others come towards it and pass. They take turns, one more every five seconds, and never stop moving: what
/// is seen of them is sharp, textured, near, and nothing to go by.
class Walkers {
 public:
  static constexpr double kAhead = 2;         ///< distance of those who walk ahead [m]
  static constexpr double kAheadSeconds = 8;  ///< for so long they keep it

  Walkers() = default;
  /// Adds their textures to the scene.
  /// @param path   of the camera, whose feet are on z = 0
  /// @param speed  of the camera along it [m/s], > 0
  Walkers(Scene& scene, CameraPath path, double speed, int count, std::uint64_t seed);

  /// Appends those who are there at time t of the camera's walk [s].
  void append(double t, std::vector<Quad>& quads) const;

 private:
  /// Where somebody is compared to the camera.
  struct Place {
    double lead = 0;   ///< as far ahead as the camera comes in so many seconds
    double aside = 0;  ///< to the left of the camera's line [m]
    bool towards = false;
    bool present = false;
  };
  [[nodiscard]] Place place(int walker, double t) const;
  [[nodiscard]] Place ahead(double since) const;
  [[nodiscard]] Place coming(double since) const;
  void append_figure(const SE3& T_w_feet, double step, int first_texture, std::vector<Quad>& quads) const;

  CameraPath path_;
  double speed_ = 1;
  std::vector<int> first_textures_;  ///< one each
};

}  // namespace twofold::synthetic
