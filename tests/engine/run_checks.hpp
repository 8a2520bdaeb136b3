#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <sstream>

#include "engine/engine.hpp"
#include "tests/engine/small_scene.hpp"
#include "tests/graph/same_map.hpp"

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
  EXPECT_TRUE(write_schedule(file, result.schedule));
  const auto schedule = read_schedule(file);
  EXPECT_TRUE(schedule) << schedule.error();
  return schedule.value_or(Schedule());
}

/// Keyframes with their observations and edges, points, places.
inline void expect_same_map(const RunResult& a, const RunResult& b) {
  expect_same(SavedMap{small_rig(), a.graph, a.places}, SavedMap{small_rig(), b.graph, b.places});
  if (::testing::Test::HasFatalFailure()) return;
  for (std::uint32_t k = 0; k < a.graph.keyframe_count(); ++k) {
    const KeyframeId id{k};
    EXPECT_EQ(a.graph.T_k_w(id).matrix(), b.graph.T_k_w(id).matrix()) << k;
    EXPECT_EQ(a.graph.part(id), b.graph.part(id)) << k;
    const EdgeList &of_a = *a.graph.keyframe(id).edges, &of_b = *b.graph.keyframe(id).edges;
    for (std::size_t n = 0; n < of_a.size(); ++n)
      EXPECT_EQ(of_a[n].T_other_this.matrix(), of_b[n].T_other_this.matrix()) << k << " " << n;
  }
}

/// Loops closed by appearance, and the corrections of the pose that frames saw.
inline void expect_same_loops(const RunResult& a, const RunResult& b) {
  ASSERT_EQ(a.loops.size(), b.loops.size());
  for (std::size_t n = 0; n < a.loops.size(); ++n) {
    const ClosedLoop &p = a.loops[n], &q = b.loops[n];
    EXPECT_EQ(p.constraint.from, q.constraint.from) << n;
    EXPECT_EQ(p.constraint.to, q.constraint.to) << n;
    EXPECT_EQ(p.constraint.T_to_from.matrix(), q.constraint.T_to_from.matrix()) << n;
    EXPECT_EQ(p.constraint.inliers, q.constraint.inliers) << n;
    EXPECT_EQ(p.T_to_from_before.matrix(), q.T_to_from_before.matrix()) << n;
    EXPECT_EQ(p.t_ns, q.t_ns) << n;
    EXPECT_EQ(p.from_t_ns, q.from_t_ns) << n;
  }
  ASSERT_EQ(a.corrections.size(), b.corrections.size());
  for (std::size_t n = 0; n < a.corrections.size(); ++n) {
    const PoseCorrection &p = a.corrections[n], &q = b.corrections[n];
    EXPECT_EQ(p.reason, q.reason) << n;
    EXPECT_EQ(p.frame_index, q.frame_index) << n;
    EXPECT_EQ(p.T_c_w_before, q.T_c_w_before) << n;
    EXPECT_EQ(p.T_c_w_after, q.T_c_w_after) << n;
  }
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
  expect_same_map(a, b);
  expect_same_loops(a, b);
  EXPECT_EQ(a.mapping.rounds, b.mapping.rounds);
  EXPECT_EQ(a.mapping.metric_loops, b.mapping.metric_loops);
  EXPECT_EQ(a.mapping.loops, b.mapping.loops);
  EXPECT_EQ(a.mapping.late_loops, b.mapping.late_loops);
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
