#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <sstream>

#include "engine/engine.hpp"
#include "tests/engine/small_scene.hpp"

/// Runs of the engine with the rig of small_scene.hpp, and what its tests ask of their results.
namespace twofold::testing {

inline RunResult run_engine(const EngineOptions& options, const FrameFeed& frames) {
  std::atomic<bool> interrupted{false};
  return Engine(small_rig(), options).run(frames, interrupted);
}

inline RunResult replay_engine(const EngineOptions& options, const FrameFeed& frames,
                               const Schedule& schedule) {
  std::atomic<bool> interrupted{false};
  return Engine(small_rig(), options).replay(frames, schedule, interrupted);
}

/// Written and read again.
inline Schedule schedule_of(const RunResult& result) {
  std::stringstream file;
  EXPECT_TRUE(
      write_schedule(file, result.schedule.tracker, result.schedule.mapper, result.schedule.loop_closer));
  const auto schedule = read_schedule(file);
  EXPECT_TRUE(schedule) << schedule.error();
  return schedule.value_or(Schedule());
}

/// Bit for bit.
inline void expect_same(const RunResult& a, const RunResult& b) {
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (std::size_t i = 0; i < a.frames.size(); ++i) {
    EXPECT_EQ(a.frames[i].state, b.frames[i].state) << i;
    EXPECT_EQ(a.frames[i].reference, b.frames[i].reference) << i;
    EXPECT_EQ(a.frames[i].snapshot_version, b.frames[i].snapshot_version) << i;
    EXPECT_EQ(a.frames[i].T_c_ref, b.frames[i].T_c_ref) << i;
    EXPECT_EQ(a.frames[i].T_c_w_causal, b.frames[i].T_c_w_causal) << i;
    EXPECT_EQ(a.frames[i].part_causal, b.frames[i].part_causal) << i;
    EXPECT_EQ(a.frames[i].effort, b.frames[i].effort) << i;
  }
  ASSERT_EQ(a.graph.keyframe_count(), b.graph.keyframe_count());
  ASSERT_EQ(a.graph.point_count(), b.graph.point_count());
  for (std::uint32_t k = 0; k < a.graph.keyframe_count(); ++k) {
    EXPECT_EQ(a.graph.T_k_w(KeyframeId{k}).matrix(), b.graph.T_k_w(KeyframeId{k}).matrix()) << k;
    EXPECT_EQ(a.graph.part(KeyframeId{k}), b.graph.part(KeyframeId{k})) << k;
  }
  for (std::uint32_t p = 0; p < a.graph.point_count(); ++p) {
    EXPECT_EQ(a.graph.point(PointId{p}).psi, b.graph.point(PointId{p}).psi) << p;
  }
}

/// A run by the schedule that `live` left: the same results, bit for bit, and the same schedule.
inline RunResult expect_replay(const EngineOptions& options, const FrameFeed& frames, const RunResult& live) {
  const Schedule schedule = schedule_of(live);
  RunResult replayed = replay_engine(options, frames, schedule);
  EXPECT_EQ(replayed.error, "");
  expect_same(live, replayed);
  EXPECT_EQ(schedule_of(replayed), schedule);
  return replayed;
}

/// Distance between the camera's place in the final map and its true one, both in the first camera's frame
/// [m].
/// @param T_c_first_true  of the frame in keyframe 0's frame
inline double position_error(const FrameRecord& record, const GraphSnapshot& graph,
                             const SE3& T_c_first_true) {
  const SE3 T_c_first = final_T_c_w(record, graph) * graph.T_k_w(KeyframeId{0}).inverse();
  return (T_c_first.inverse().translation() - T_c_first_true.inverse().translation()).norm();
}

}  // namespace twofold::testing
