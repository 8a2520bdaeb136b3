// To and fro over a desk, never twice from the same places: what is mapped is reused, and not closed as a
// loop again and again.
#include <gtest/gtest.h>

#include "io/sources/open_source.hpp"
#include "tests/engine/whole_run.hpp"

namespace twofold {
namespace {

std::size_t points_alive(const GraphSnapshot& graph) {
  std::size_t count = 0;
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) count += graph.point(PointId{p}).culled() ? 0 : 1;
  return count;
}

struct TwiceSeen {
  RunResult result;
  std::size_t after_return = 0;  ///< points of the map when the camera has been to and fro once
};

/// To and fro twice, in a minute.
TwiceSeen look_twice(const std::string& text, const SourceOptions& source_options) {
  const auto source = open_source(text, source_options);
  constexpr std::int64_t kBack = 30'000'000'000;  // [ns]
  TwiceSeen seen;
  EngineOptions options;
  options.on_map = [&](const GraphSnapshot& graph, const DoubleWindow&) {
    const std::int64_t t_ns = graph.keyframe(graph.reference()).t_ns - graph.keyframe(KeyframeId{0}).t_ns;
    if (t_ns < kBack) seen.after_return = points_alive(graph);
  };
  seen.result = testing::run_whole(source->rig(), testing::frames_of(*source), std::move(options)).result;
  for (const FrameRecord& record : seen.result.frames)
    EXPECT_TRUE(has_final_pose(record)) << record.frame_index;
  return seen;
}

TEST(SeenAgain, OneCamerasMapGetsHardlyAnyNewPoints) {
  SourceOptions left_only;
  left_only.left_only = true;
  const TwiceSeen seen = look_twice("synthetic:desk?frames=450&fps=7.5&width=320&height=240", left_only);
  EXPECT_GT(seen.after_return, 1000u);
  EXPECT_LT(points_alive(seen.result.graph), seen.after_return + seen.after_return / 4);
  // It is recognised all the time, and the map has known it as exactly before.
  EXPECT_TRUE(seen.result.loops.empty()) << seen.result.loops.size();
}

TEST(SeenAgain, APairsMapGetsHardlyAnyNewPoints) {
  const TwiceSeen seen = look_twice("synthetic:desk?frames=300&fps=5&width=640&height=480", {});
  EXPECT_GT(seen.after_return, 1000u);
  EXPECT_LT(points_alive(seen.result.graph), seen.after_return + seen.after_return / 4);
}

}  // namespace
}  // namespace twofold
