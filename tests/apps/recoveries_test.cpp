#include "apps/twofold/recoveries.hpp"

#include <gtest/gtest.h>

#include "apps/twofold/map_parts.hpp"
#include "graph/graph_writer.hpp"

namespace twofold {
namespace {

/// A map of two parts, of keyframes 0 and 1, and frames tracked in them.
class RecoveriesTest : public ::testing::Test {
 protected:
  RecoveriesTest() {
    for (std::uint32_t k = 0; k < 2; ++k) {
      Keyframe keyframe;
      keyframe.id = keyframe.part = KeyframeId{k};
      writer_.add_keyframe(std::move(keyframe));
    }
    result_.graph = writer_.publish();
  }
  void add(FrameState state) {
    FrameRecord record;
    record.frame_index = static_cast<std::int64_t>(result_.frames.size());
    record.t_ns = 1000 * record.frame_index;
    record.state = state;
    result_.frames.push_back(record);
  }
  /// At x in the final map; `part` as it was called then.
  void add_tracked(double x, std::uint32_t reference, std::uint32_t part) {
    add(FrameState::kTracked);
    FrameRecord& record = result_.frames[result_.frames.size() - 1];
    record.reference = KeyframeId{reference};
    record.part_causal = KeyframeId{part};
    record.T_c_ref = PackedPose(SE3(SO3(), Vector3(-x, 0, 0)));
  }

  GraphWriter writer_;
  RunResult result_;
};

TEST_F(RecoveriesTest, ACameraThatFoundItselfHasMoved) {
  add_tracked(1, 0, 0);
  add(FrameState::kLost);
  add(FrameState::kDropped);
  add(FrameState::kPlacedLater);
  add_tracked(4, 0, 0);
  add(FrameState::kDropped);
  add_tracked(5, 0, 0);
  const auto found = recoveries(result_, 0);
  ASSERT_EQ(found.size(), 1U) << "who was dropped was not lost";
  EXPECT_EQ(found[0].frame, 4);
  EXPECT_EQ(found[0].t_ns, 4000);
  EXPECT_EQ(found[0].lost_frames, 2);
  EXPECT_FALSE(found[0].new_part);
  ASSERT_TRUE(found[0].T_last_now);
  EXPECT_NEAR(found[0].T_last_now->translation().x(), 3, 1e-6);
}

TEST_F(RecoveriesTest, ANewPartHasAWorldOfItsOwnUntilItJoins) {
  add_tracked(1, 0, 0);
  add(FrameState::kLost);
  add_tracked(2, 1, 1);
  add(FrameState::kLost);
  add_tracked(3, 0, 7);  // whose part has joined the first
  add(FrameState::kLost);
  add_tracked(4, 1, 1);
  const auto found = recoveries(result_, 0);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_TRUE(found[0].new_part && found[1].new_part);
  EXPECT_FALSE(found[2].new_part) << "it has been there before";
  for (const Recovery& one : found) EXPECT_FALSE(one.T_last_now) << "two parts of the final map";
}

// The replacements of a run whose disk was full may be lost.
TEST_F(RecoveriesTest, WhoseKeyframeWasForgottenHasNoPlace) {
  writer_.set_part(KeyframeId{1}, KeyframeId{0});
  writer_.set_reference(KeyframeId{0});
  writer_.cull_keyframe(KeyframeId{1}, KeyframeId{0});
  writer_.forget_replacements(0);
  result_.graph = writer_.publish();
  add_tracked(1, 1, 0);
  add(FrameState::kLost);
  add_tracked(4, 1, 0);
  const auto found = recoveries(result_, 0);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_FALSE(found[0].T_last_now);
  const auto parts = map_parts(result_, {});
  ASSERT_EQ(parts.size(), 1U);
  EXPECT_TRUE(parts[0].trajectory.empty());
}

TEST_F(RecoveriesTest, TheStartOfTheFirstMapIsNone) {
  add(FrameState::kLost);
  add_tracked(1, 0, 0);
  EXPECT_TRUE(recoveries(result_, 0).empty());
  const auto in_loaded = recoveries(result_, 1);
  ASSERT_EQ(in_loaded.size(), 1U) << "it has found itself in the map that was loaded";
  EXPECT_FALSE(in_loaded[0].new_part);
}

TEST_F(RecoveriesTest, APartBesideTheLoadedMapIsNew) {
  add(FrameState::kLost);
  add_tracked(1, 1, 1);
  const auto found = recoveries(result_, 1);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_TRUE(found[0].new_part);
}

}  // namespace
}  // namespace twofold
