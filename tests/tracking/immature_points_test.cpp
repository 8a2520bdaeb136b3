#include "tracking/common/immature_points.hpp"

#include <gtest/gtest.h>

#include <utility>

#include "fixtures/plain_map.hpp"

namespace twofold {
namespace {

constexpr KeyframeId kFirst{0}, kSecond{1};

ImmaturePoint point_of(KeyframeId anchor) {
  ImmaturePoint point;
  point.anchor = point.usable_since = anchor;
  return point;
}

TEST(ImmaturePoints, NeverGrowBeyondTheirCapacity) {
  ImmaturePoints points(3, 2);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(points.add(point_of(kFirst)));
  EXPECT_FALSE(points.add(point_of(kFirst)));
  EXPECT_EQ(points.points().size(), 3U);
  EXPECT_TRUE(points.room_for_keyframe());
  points.add_pending({.id = kFirst, .reference = kNoKeyframe, .T_k_ref = SE3()});
  points.add_pending({.id = kSecond, .reference = kFirst, .T_k_ref = SE3()});
  EXPECT_FALSE(points.room_for_keyframe());
}

TEST(ImmaturePoints, FindProposedKeyframes) {
  ImmaturePoints points(1, 2);
  points.add_pending({.id = kSecond, .reference = kFirst, .T_k_ref = SE3()});
  ASSERT_NE(points.find_pending(kSecond), nullptr);
  EXPECT_EQ(points.find_pending(kSecond)->reference, kFirst);
  EXPECT_EQ(points.find_pending(kFirst), nullptr);
}

TEST(ImmaturePoints, SayWhenTheyChanged) {
  ImmaturePoints points(1, 1);
  std::uint64_t before = points.revision();
  const auto changed = [&] { return std::exchange(before, points.revision()) != points.revision(); };
  EXPECT_TRUE(points.add(point_of(kFirst)));
  EXPECT_TRUE(changed());
  EXPECT_FALSE(points.add(point_of(kFirst)));  // full: nothing happened
  EXPECT_FALSE(changed());
  points.add_pending({.id = kFirst, .reference = kNoKeyframe, .T_k_ref = SE3()});
  EXPECT_TRUE(changed());
  points.drop_stale(kFirst, 1, 1);
  EXPECT_TRUE(changed());
  points.clear_points();
  EXPECT_TRUE(changed());
}

TEST(ImmaturePoints, GiveUpWhatIsOldOrOftenMissed) {
  ImmaturePoints points(8, 1);
  ImmaturePoint missed = point_of(KeyframeId{9});
  missed.failures = 4;
  ImmaturePoint nearly_missed = point_of(KeyframeId{9});
  nearly_missed.failures = 3;
  ImmaturePoint proposed = point_of(KeyframeId{1});  // the map is about to have it
  proposed.failures = 4;
  proposed.proposed_in = KeyframeId{8};
  for (const ImmaturePoint& point :
       {missed, nearly_missed, proposed, point_of(KeyframeId{7}), point_of(KeyframeId{6})})
    ASSERT_TRUE(points.add(point));
  points.drop_stale(KeyframeId{10}, 4, 3);
  ASSERT_EQ(points.points().size(), 3U);
  EXPECT_EQ(points.points()[0].failures, 3);
  EXPECT_EQ(points.points()[1].proposed_in, KeyframeId{8});
  EXPECT_EQ(points.points()[2].anchor, KeyframeId{7});
}

/// A map with these keyframes, each the reference of the next.
GraphSnapshot map_with(int keyframes) {
  PlainMap map;
  for (int i = 0; i < keyframes; ++i) {
    KeyframeProposal proposal;
    proposal.id = KeyframeId{static_cast<std::uint32_t>(i)};
    proposal.reference = i > 0 ? KeyframeId{static_cast<std::uint32_t>(i - 1)} : kNoKeyframe;
    map.insert(proposal);
  }
  return map.publish();
}

TEST(ImmaturePoints, AreForgottenWhenTheMapHasTakenThemOver) {
  ImmaturePoints points(4, 2);
  points.add_pending({.id = KeyframeId{1}, .reference = KeyframeId{0}, .T_k_ref = SE3()});
  points.add_pending({.id = KeyframeId{2}, .reference = KeyframeId{1}, .T_k_ref = SE3()});
  ImmaturePoint taken = point_of(KeyframeId{0});
  taken.proposed_in = KeyframeId{1};
  ImmaturePoint under_way = point_of(KeyframeId{0});
  under_way.proposed_in = KeyframeId{2};
  const ImmaturePoint unproposed = point_of(KeyframeId{1});  // its anchor is in the map, the point is not
  for (const ImmaturePoint& point : {taken, under_way, unproposed}) ASSERT_TRUE(points.add(point));
  const std::uint64_t before = points.revision();

  points.forget_mapped(map_with(2));

  EXPECT_GT(points.revision(), before);
  ASSERT_EQ(points.pending().size(), 1U);
  EXPECT_EQ(points.pending()[0].id, KeyframeId{2});
  ASSERT_EQ(points.points().size(), 2U);
  EXPECT_EQ(points.points()[0].proposed_in, KeyframeId{2});
  EXPECT_EQ(points.points()[1].anchor, KeyframeId{1});
  EXPECT_EQ(points.points()[1].proposed_in, kNoKeyframe);
}

}  // namespace
}  // namespace twofold
