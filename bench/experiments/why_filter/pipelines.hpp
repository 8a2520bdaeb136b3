#pragma once

#include "experiments/why_filter/settings.hpp"

namespace twofold::bench {

/// Outcome of one SLAM run over a block.
struct PipelineResult {
  bool ok = false;           ///< finished with finite numbers
  SE3 T_last_first;          ///< estimated motion from frame 0 to frame M (unit of length free for monocular)
  double joint_seconds = 0;  ///< processor time in joint BA updates or joint filter updates
  double total_seconds = 0;  ///< of the whole pipeline after the monocular bootstrap
};

/// Algorithm 3: motion-only, structure-only, full bundle adjustment for every frame; the library's own
/// solver.
[[nodiscard]] PipelineResult run_bundle_adjustment(const Block& block, int iterations);
/// Algorithm 5, derivatives at first estimates.
[[nodiscard]] PipelineResult run_filter(const Block& block, int iterations, MotionEstimate motion);

/// Error of the end position in the frame of camera 0 [m]: 3 components for stereo; 2 for monocular, after
/// scaling to the true length, in the tangent plane of the sphere  (eq. 4.27 - 4.29).
[[nodiscard]] VectorX end_error(const Block& block, const PipelineResult& result);

[[nodiscard]] double thread_seconds();

}  // namespace twofold::bench
