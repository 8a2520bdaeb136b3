#pragma once

#include <optional>
#include <vector>

#include "estimation/window_solver.hpp"
#include "experiments/scale_drift/scene.hpp"

namespace twofold::bench {

struct ExplorationOptions {
  int window = 10;             ///< keyframes adjusted together, >= 3
  int iterations = 10;         ///< of bundle adjustment a frame
  double min_parallax = 0.05;  ///< of a new point [rad]
  double huber_sigmas = 3;     ///< kernel of bundle adjustment (thesis 3.5)
};

/// One point from its first to its last sighting without a gap. A point of the scene that comes into view
/// again starts another track: recognising it is the business of the loop closer.
struct Track {
  int point = 0;  ///< of the scene
  int first_frame = 0;
  std::vector<Vector2> uv;  ///< one a frame
  std::optional<Vector3> x_w = {};
  [[nodiscard]] int last_frame() const { return first_frame + static_cast<int>(uv.size()) - 1; }
};

/// What monocular exploration estimated. The scale is that of the start and drifts from there.
struct ExplorationResult {
  std::vector<SE3> T_c_w;
  std::vector<Track> tracks;
  std::vector<std::vector<int>> seen;  ///< tracks of each frame
};

/// Monocular exploration with known association  (thesis chapter 3, as in 5.4): every frame is a keyframe;
/// its pose comes from motion-only bundle adjustment, new points from triangulation, then bundle adjustment
/// of the last `window` frames with the first two of them fixed (3.3.3). The two-view start is not simulated.
///
/// @param T_first, T_second  poses given to the first two frames, which fix the gauge
/// @return  nullopt when a frame cannot be placed
[[nodiscard]] std::optional<ExplorationResult> explore(const Rig& rig,
                                                       const std::vector<std::vector<Sighting>>& frames,
                                                       const SE3& T_first, const SE3& T_second,
                                                       const ExplorationOptions& options);

}  // namespace twofold::bench
