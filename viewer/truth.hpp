#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "viewer/scene.hpp"

namespace twofold {

/// A pose that was tracked.
struct TrackedPose {
  std::int64_t t_ns = 0;
  Pose T_world_camera;
  std::uint32_t part = 0;  ///< whose world
};

/// Lays the true path beside the tracked one: it stands where the first tracked pose does. The unit of one
/// camera is its own; then the path is also scaled, by how far the camera has come from its first position
/// over how far it truly has, and laid anew whenever it has come half as far again.
class TruthBeside {
 public:
  /// @param truth   T_world_camera in any world
  /// @param t_ns    its times, ascending, as many; else there is nothing to lay
  /// @param scaled  the tracked poses have a unit of their own
  TruthBeside(std::vector<Pose> truth, std::vector<std::int64_t> t_ns, bool scaled);

  /// Poses in the order of time.
  /// @return the true path in the world of the first of them, at most 4096 positions, if this pose says where
  ///         or how large it is
  [[nodiscard]] std::optional<ViewTruth> add(const TrackedPose& tracked);

 private:
  [[nodiscard]] const Pose& true_pose(std::int64_t t_ns) const;
  /// Of the tracked unit over that of the truth, if this pose is far enough from the first.
  [[nodiscard]] std::optional<double> find_scale(const TrackedPose& tracked);
  [[nodiscard]] ViewTruth lay(double scale) const;

  const std::vector<Pose> truth_;
  const std::vector<std::int64_t> t_ns_;
  const bool scaled_;
  std::optional<TrackedPose> first_;
  double farthest_ = 0;  ///< from the first position, when the scale was found
};

}  // namespace twofold
