// One camera to and fro over a desk, never twice from the same places: what is mapped is reused, and not
// closed as a loop again and again.
#include <gtest/gtest.h>

#include "io/sources/open_source.hpp"
#include "tests/engine/whole_run.hpp"

namespace twofold {
namespace {

std::size_t points_alive(const GraphSnapshot& graph) {
  std::size_t count = 0;
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) count += graph.point(PointId{p}).alive() ? 1 : 0;
  return count;
}

TEST(OneCameraDesk, SeenAgainItGetsHardlyAnyNewPoints) {
  SourceOptions source_options;
  source_options.left_only = true;
  const auto source = open_source("synthetic:desk?frames=450&fps=7.5&width=320&height=240", source_options);
  // Once to and fro takes half of the run.
  constexpr std::int64_t kBack = 30'000'000'000;  // [ns]
  std::size_t after_return = 0;
  EngineOptions options;
  options.on_map = [&](const GraphSnapshot& graph, const DoubleWindow&) {
    const std::int64_t t_ns = graph.keyframe(graph.reference()).t_ns - graph.keyframe(KeyframeId{0}).t_ns;
    if (t_ns < kBack) after_return = points_alive(graph);
  };
  const auto run = testing::run_whole(source->rig(), testing::frames_of(*source), std::move(options));
  for (const FrameRecord& record : run.result.frames)
    EXPECT_TRUE(has_final_pose(record)) << record.frame_index;
  EXPECT_GT(after_return, 1000u);
  EXPECT_LT(points_alive(run.result.graph), after_return + after_return / 4);
  // It is recognised all the time, and the map has known it as exactly before.
  EXPECT_TRUE(run.result.loops.empty()) << run.result.loops.size();
}

}  // namespace
}  // namespace twofold
