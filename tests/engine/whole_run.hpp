#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <utility>

#include "engine/engine.hpp"
#include "evaluation/evaluation.hpp"
#include "io/sources/frame_source.hpp"
#include "synthetic/synthetic_sequence.hpp"

/// Deterministic runs over any rig's frames, and the path they end with beside the true one.
namespace twofold::testing {

struct WholeRun {
  RunResult result;
  Trajectory path;  ///< of the frames that have a pose in the final map
};

inline WholeRun run_whole(const Rig& rig, const FrameFeed& frames, EngineOptions options = {}) {
  options.deterministic = true;
  const std::atomic<bool> interrupted{false};
  WholeRun run{Engine(rig, std::move(options)).run(frames, interrupted), {}};
  EXPECT_EQ(run.result.error, "");
  for (const FrameRecord& record : run.result.frames) {
    if (has_final_pose(record))
      run.path.push_back({record.t_ns, final_T_c_w(record, run.result.graph).inverse()});
  }
  return run;
}

/// `source` must outlive the feed.
inline FrameFeed frames_of(FrameSource& source) {
  return [&source](Frame& frame) { return source.next(frame); };
}

/// `sequence` must outlive the feed.
inline FrameFeed frames_of(const synthetic::SyntheticSequence& sequence) {
  return [&sequence, next = 0](Frame& frame) mutable {
    if (next == sequence.frame_count()) return FrameStatus::kEnd;
    frame = sequence.render(next++);
    return FrameStatus::kFrame;
  };
}

inline Trajectory true_path(const synthetic::SyntheticSequence& sequence) {
  Trajectory truth;
  for (int i = 0; i < sequence.frame_count(); ++i) truth.push_back({sequence.t_ns(i), sequence.T_w_c(i)});
  return truth;
}

}  // namespace twofold::testing
