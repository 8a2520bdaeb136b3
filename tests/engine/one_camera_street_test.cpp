// One camera in a street of few houses: what there is to see stands in a narrow band of a small image.
#include <gtest/gtest.h>

#include "io/sources/open_source.hpp"
#include "tests/engine/whole_run.hpp"

namespace twofold {
namespace {

TEST(OneCameraStreet, NoFrameIsLostThoughOnlyABandOfTheImageHasCorners) {
  SourceOptions source_options;
  source_options.left_only = true;
  const auto source = open_source("synthetic:campus?frames=130", source_options);
  const auto [result, path] = testing::run_whole(source->rig(), testing::frames_of(*source));
  for (const FrameRecord& record : result.frames) {
    EXPECT_TRUE(has_final_pose(record)) << record.frame_index;
  }
  const auto evaluation =
      evaluate(associate(path, source->ground_truth(), 10'000'000), {.alignment = Alignment::kSim3});
  ASSERT_TRUE(evaluation);
  EXPECT_LT(evaluation->absolute.rmse, 0.005 * evaluation->path_length);
}

}  // namespace
}  // namespace twofold
