// Which keyframe poses are relative to.
#include "tracking/keyframes/reference_choice.hpp"

#include <gtest/gtest.h>

#include "fixtures/plain_map.hpp"
#include "fixtures/rendered_scene.hpp"

namespace twofold {
namespace {

using namespace testing;

constexpr int kPoints = 100;
constexpr KeyframeId kFirst{0}, kSecond{1};

/// Two keyframes: the first sees all points, the second a part of them.
class ReferenceChoiceTest : public ::testing::Test {
 protected:
  void make_map(int seen_by_second) {
    map_.insert(keyframe(kFirst, kNoKeyframe, kPoints));
    map_.insert(keyframe(kSecond, kFirst, seen_by_second));
    snapshot_ = map_.publish();
    local_map_.update(snapshot_, kSecond, ImmaturePoints(1, 1), 20);
    for (std::uint32_t i = 0; i < local_map_.points().size(); ++i) {
      found_.matches.push_back({i, {}});
      found_.observations.push_back({local_map_.points()[i].x_ref, {1, 2, 3}, {1, 1, 1}});
      found_.observations.back().inlier = true;
    }
  }
  static KeyframeProposal keyframe(KeyframeId id, KeyframeId reference, int points) {
    KeyframeProposal result;
    result.id = id;
    result.reference = reference;
    for (int i = 0; i < points; ++i) {
      const PointId point{static_cast<std::uint32_t>(i)};
      const Observation seen{point, {1, 2, 3}, 0};
      if (reference == kNoKeyframe) result.points.push_back({point, id, {0, 0, 0.5}, seen, {}});
      if (reference != kNoKeyframe) result.observations.push_back(seen);
    }
    return result;
  }
  /// Within as many frames as one look takes.
  std::optional<KeyframeId> better() {
    for (int i = 0; i < 3; ++i) {
      choice_.begin_frame();
      if (const auto id = choice_.better(snapshot_, kSecond, local_map_, found_)) return id;
    }
    return std::nullopt;
  }

  PlainMap map_;
  GraphSnapshot snapshot_;
  LocalMap local_map_{200};
  SearchOutcome found_{test_rig(SensorKind::kStereo, 320, 240), LocalMapSearchOptions().max_searches};
  ReferenceChoice choice_{{}, 200};
};

TEST_F(ReferenceChoiceTest, ThatWhichSeesMostOfWhatIsFound) {
  make_map(50);
  ASSERT_EQ(found_.matches.size(), static_cast<std::size_t>(kPoints));
  EXPECT_EQ(better(), kFirst);
}

TEST_F(ReferenceChoiceTest, NotWhatIsHardlyBetter) {
  make_map(90);
  EXPECT_EQ(better(), std::nullopt);
}

TEST_F(ReferenceChoiceTest, ByHowMuchIsAnOption) {
  make_map(90);
  choice_ = ReferenceChoice({.min_gain_share = 0.1}, 200);
  EXPECT_EQ(better(), kFirst);
  choice_ = ReferenceChoice({.interval = 4, .min_gain_share = 0.1}, 200);
  EXPECT_EQ(better(), std::nullopt) << "within three frames nobody looks";
}

TEST_F(ReferenceChoiceTest, OnlyWhatAgreesWithThePoseCounts) {
  make_map(50);
  for (std::size_t m = 0; m < found_.matches.size(); ++m) {
    found_.observations[m].inlier = index(local_map_.points()[found_.matches[m].point].id) < 50;
  }
  EXPECT_EQ(better(), std::nullopt) << "the second sees all of these, too";
}

}  // namespace
}  // namespace twofold
