#include "tracking/loss/assumed_placements.hpp"

#include <gtest/gtest.h>

#include "tests/graph/graph_pieces.hpp"

namespace twofold {
namespace {

/// Two parts, in each a keyframe that looks ahead and one that looks to the right, where it is, at a scene 2
/// m away; the second part's stand where the first part's do.
class AssumedPlacementsTest : public ::testing::Test {
 protected:
  AssumedPlacementsTest() {
    for (const std::uint32_t part : {0U, 2U})
      for (const std::uint32_t turned : {0U, 1U}) {
        Keyframe keyframe;
        keyframe.id = KeyframeId{part + turned};
        keyframe.part = KeyframeId{part};
        keyframe.median_depth = 2;
        keyframe.T_k_w = T_c_w(turned == 1 ? 1.5 : 0);
        writer_.add_keyframe(keyframe);
      }
    graph_ = writer_.publish();
  }
  static SE3 T_c_w(double turned) { return {SO3::exp(Vector3(0, turned, 0)), Vector3::Zero()}; }
  static AssumedPose assumed(double turned, KeyframeId part = kNoKeyframe) {
    return {part, T_c_w(turned).inverse(), 0.1, 0.02};
  }

  GraphWriter writer_;
  GraphSnapshot graph_;
};

TEST_F(AssumedPlacementsTest, ThePoseItselfComesFirstSeenFromTheKeyframeThatLooksTheSameWay) {
  for (const double turned : {0.2, 1.3}) {
    const auto first = AssumedPlacements(graph_, assumed(turned)).next();
    ASSERT_TRUE(first);
    EXPECT_EQ(first->reference, KeyframeId{turned < 1 ? 0U : 1U}) << "the oldest part's";
    const SE3 off = first->T_c_ref * graph_.T_k_w(first->reference) * T_c_w(turned).inverse();
    EXPECT_LT(off.log().norm(), 1e-12);
    EXPECT_EQ(AssumedPlacements(graph_, assumed(turned, KeyframeId{2})).next()->reference,
              KeyframeId{turned < 1 ? 2U : 3U});
  }
}

TEST_F(AssumedPlacementsTest, OthersLieAroundItAsFarAsItIsUncertain) {
  AssumedPlacements placements(graph_, assumed(0)), again(graph_, assumed(0));
  (void)placements.next();
  (void)again.next();
  Vector6 squares = Vector6::Zero(), sum = Vector6::Zero();
  int count = 0;
  while (const auto placement = placements.next()) {
    const Vector6 off = placement->T_c_ref.log();
    EXPECT_EQ(off, again.next()->T_c_ref.log()) << "the same each time";
    squares += off.cwiseProduct(off);
    sum += off;
    ++count;
  }
  EXPECT_EQ(count, 60 * AssumedPlacements::kTriesAFrame - 1);
  for (int i = 0; i < 6; ++i) {
    const double sigma = i < 3 ? 0.1 : 0.02;
    EXPECT_NEAR(std::sqrt(squares[i] / count), sigma, 0.2 * sigma) << i;
    EXPECT_LT(std::abs(sum[i] / count), 0.3 * sigma) << i;
  }
}

TEST_F(AssumedPlacementsTest, WhereNobodySaysAnythingOrThePartIsNotThereThereAreNone) {
  EXPECT_FALSE(AssumedPlacements().next());
  EXPECT_FALSE(AssumedPlacements(graph_, assumed(0, KeyframeId{1})).next());
  EXPECT_FALSE(AssumedPlacements(GraphSnapshot(), assumed(0)).next());
}

}  // namespace
}  // namespace twofold
