#pragma once

#include <string>
#include <vector>

#include "experiments/why_filter/gauss_newton_filter.hpp"

namespace twofold::bench {

/// The four motions of thesis 4.6.1 (figure 4.4).
enum class Setting : int { kSideways = 0, kSidewaysPartial = 1, kSidewaysRotation = 2, kSharpTurn = 3 };

[[nodiscard]] std::string setting_name(Setting setting);
[[nodiscard]] std::vector<int> frame_counts(Setting setting);  ///< M
[[nodiscard]] int iterations(Setting setting);                 ///< LM steps: 3 or 10 (4.6.1)
[[nodiscard]] Rig why_rig(SensorKind kind);

/// One simulated building block: what each time step loses, gains and sees. Frame -2 and -1 are the monocular
/// bootstrap frames; frame 0 is the reference, 1 ... M the trajectory.
struct Block {
  Rig rig;
  std::vector<SE3> T_c_w;                                ///< true, [0] ... [M]
  std::vector<std::vector<PointObservation>> bootstrap;  ///< monocular: two frames
  struct Step {
    std::vector<std::int64_t> lost;
    std::vector<PointObservation> fresh;    ///< measured in the previous frame
    std::vector<PointObservation> current;  ///< N of them
  };
  std::vector<PointObservation> first;  ///< frame 0
  std::vector<Step> steps;              ///< [0] is frame 1
};

/// Points are drawn uniformly over the image of the frame they start in; noise 0.5 px. Same seed, same scene;
/// cells <M, N> of one seed share points and noise as far as they have the same points and frames.
[[nodiscard]] Block simulate_block(Setting setting, SensorKind kind, int frames, int points, unsigned seed);

}  // namespace twofold::bench
