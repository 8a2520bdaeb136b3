// One camera in a street of few houses: what there is to see stands in a narrow band of a small image.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

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

/// By how much the scales of both halves of a run differ, as a share.
double drift_of_scale(const std::string& text) {
  const auto source = open_source(text, {});
  const auto [result, path] = testing::run_whole(source->rig(), testing::frames_of(*source));
  const auto evaluation =
      evaluate(associate(path, source->ground_truth(), 10'000'000), {.alignment = Alignment::kSim3});
  if (!evaluation || !evaluation->half_scales) return std::numeric_limits<double>::infinity();
  return std::abs((*evaluation->half_scales)[1] / (*evaluation->half_scales)[0] - 1);
}

// Nothing but the points that the map gets from frame to frame holds its unit. When those whose depth was
// known late had no time to be found again, the halves were 8.6, 2.1 and 0.2 % apart.
TEST(OneCameraStreet, TheUnitIsKeptAlongACorridor) {
  double sum = 0;
  for (const char* seed : {"1", "2", "3"})
    sum += drift_of_scale(
        std::string("synthetic:corridor?sensor=mono&frames=300&width=320&height=240&seed=") + seed);
  EXPECT_LT(sum / 3, 0.01);
}

// Points last for a few keyframes there. Had the camera waited with keyframes as it does where it sees a
// place again, the halves would be 1.3 and 0.7 % apart.
TEST(OneCameraStreet, TheUnitIsKeptByACarThatPassesHouses) {
  double sum = 0;
  for (const char* seed : {"1", "2"})
    sum += drift_of_scale(std::string("synthetic:terrace?sensor=mono&frames=150&seed=") + seed);
  EXPECT_LT(sum / 2, 0.006);
}

}  // namespace
}  // namespace twofold
