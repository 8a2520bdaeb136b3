// One camera in a street of few houses: what there is to see stands in a narrow band of a small image.
#include <gtest/gtest.h>

#include <atomic>

#include "engine/engine.hpp"
#include "evaluation/evaluation.hpp"
#include "io/sources/open_source.hpp"

namespace twofold {
namespace {

TEST(OneCameraStreet, NoFrameIsLostThoughOnlyABandOfTheImageHasCorners) {
  SourceOptions source_options;
  source_options.left_only = true;
  const auto source = open_source("synthetic:campus?frames=130", source_options);
  EngineOptions options;
  options.deterministic = true;
  const FrameFeed feed = [&](Frame& frame) {
    return source->next(frame) == FrameStatus::kFrame ? FeedStatus::kFrame : FeedStatus::kEnd;
  };
  const std::atomic<bool> interrupted{false};
  const RunResult result = Engine(source->rig(), options).run(feed, interrupted);
  ASSERT_EQ(result.error, "");
  Trajectory estimate;
  for (const FrameRecord& record : result.frames) {
    EXPECT_TRUE(has_final_pose(record)) << record.frame_index;
    if (has_final_pose(record))
      estimate.push_back({record.t_ns, final_T_c_w(record, result.graph).inverse()});
  }
  const auto evaluation =
      evaluate(associate(estimate, source->ground_truth(), 10'000'000), {.alignment = Alignment::kSim3});
  ASSERT_TRUE(evaluation);
  EXPECT_LT(evaluation->absolute.rmse, 0.005 * evaluation->path_length);
}

}  // namespace
}  // namespace twofold
