#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "geometry/ransac.hpp"
#include "loopclosure/described_place.hpp"
#include "loopclosure/geometric_verification.hpp"
#include "synthetic/image_effects.hpp"
#include "tests/loopclosure/turning_camera.hpp"

namespace twofold {
namespace {

using testing::pose;
using testing::RenderedScene;
using testing::test_rig;
using testing::vocabulary;

/// Two rooms of the same size with different walls, described by the same rig.
class PlaceTest : public ::testing::TestWithParam<SensorKind> {
 protected:
  Rig rig_ = test_rig(GetParam());
  PlaceDescriber describer_{rig_, {}};

  DescribedPlace view(std::uint32_t room, const SE3& T_c_w) {
    RenderedScene scene(rig_, Vector3(3, 2, 4), room);
    FrameImages images;
    scene.render(T_c_w, 2.0, images);
    return describer_.describe(images, *vocabulary());
  }
  /// With so much of the light, and the noise that a sensor has then.
  DescribedPlace view_in_the_dark(std::uint32_t room, const SE3& T_c_w, double gain) {
    RenderedScene scene(rig_, Vector3(3, 2, 4), room);
    FrameImages images;
    scene.render(T_c_w, 0, images);
    std::uint64_t stream = room;
    for (ImagePyramid* pyramid : {&images.left, &images.right}) {
      if (pyramid == &images.right && rig_.kind != SensorKind::kStereo) continue;
      cv::Mat light;
      pyramid->level(0).convertTo(light, CV_32FC1);
      pyramid->build(synthetic::expose(light, gain, 3, {1, 2 * stream++}));
    }
    return describer_.describe(images, *vocabulary());
  }
  std::optional<VerifiedPlace> verify(const DescribedPlace& a, const DescribedPlace& b,
                                      VerificationOptions options = {},
                                      VerificationReport* report = nullptr) {
    const PlacedView place{&a, SE3()};
    return verify_place(rig_, {&place, 1}, b, options, report);
  }
};

TEST_P(PlaceTest, DescribesManyCornersSpreadOverTheImageWithTheirDepth) {
  const SE3 T_c_w = pose(0.2, {0.3, 0, 0});
  const DescribedPlace place = view(1, T_c_w);
  ASSERT_EQ(place.pixels.size(), place.corners.size());
  EXPECT_GT(place.corners.size(), 300U);
  EXPECT_LE(place.corners.size(), 500U);
  std::map<int, int> quadrants;
  const RenderedScene scene(rig_, Vector3(3, 2, 4), 1);
  int right = 0, with_depth = 0;
  for (std::size_t i = 0; i < place.corners.size(); ++i) {
    const Vector2 uv = place.corners[i].uv.cast<double>();
    ++quadrants[(uv.x() < 320 ? 0 : 1) + (uv.y() < 240 ? 0 : 2)];
    if (!std::isfinite(place.pixels[i].z())) continue;
    ++with_depth;
    const double disparity = rig_.disparity_from_depth(scene.depth(T_c_w, uv));
    right += std::abs(uv.x() - place.pixels[i].z() - disparity) < 1.0 ? 1 : 0;
  }
  for (const auto& [quadrant, count] : quadrants) EXPECT_GT(count, 40) << quadrant;
  EXPECT_GT(with_depth, 150);
  EXPECT_GT(right, 0.9 * with_depth);
  double sum = 0;
  for (const auto& [word, weight] : place.bag) sum += weight;
  EXPECT_NEAR(sum, 1, 1e-4);
}

TEST_P(PlaceTest, VerifiesTheSamePlaceAndFindsThePose) {
  const SE3 T_a_w = pose(0.1, {0.2, 0.1, -0.5});
  const SE3 T_b_w = pose(-0.05, {-0.1, 0, -0.2});
  VerificationReport report;
  const auto verified = verify(view(1, T_a_w), view(1, T_b_w), {}, &report);
  ASSERT_TRUE(verified) << report.matches << " matches, " << report.ransac_inliers << " in RANSAC, "
                        << report.inliers << " of " << report.guided << " guided";
  const Vector6 error = (verified->T_b_a * (T_b_w * T_a_w.inverse()).inverse()).log();
  EXPECT_LT(error.head<3>().norm(), 0.03);
  EXPECT_LT(error.tail<3>().norm(), 0.01);
  EXPECT_GE(verified->inliers, VerificationOptions().min_inliers);
}

/// A hundred grey levels are seven, and noise is three.
TEST_P(PlaceTest, VerifiesTheSamePlaceInTheDark) {
  constexpr double kGain = 0.07;
  const SE3 T_a_w = pose(0.1, {0.2, 0.1, -0.5});
  const SE3 T_b_w = pose(-0.05, {-0.1, 0, -0.2});
  const DescribedPlace place = view_in_the_dark(1, T_a_w, kGain);
  VerificationReport report;
  const auto verified = verify(place, view_in_the_dark(1, T_b_w, kGain), {}, &report);
  ASSERT_TRUE(verified) << place.corners.size() << " corners, " << report.matches << " matches, "
                        << report.ransac_inliers << " in RANSAC, " << report.inliers << " of "
                        << report.guided << " guided";
  const Vector6 error = (verified->T_b_a * (T_b_w * T_a_w.inverse()).inverse()).log();
  EXPECT_LT(error.head<3>().norm(), 0.3);  // noise is in the depths as well; the map's points find it exactly
  EXPECT_LT(error.tail<3>().norm(), 0.05);
  for (std::uint32_t room = 2; room < 6; ++room)
    EXPECT_FALSE(verify(place, view_in_the_dark(room, T_b_w, kGain))) << room;
}

TEST_P(PlaceTest, RejectsAnotherRoomAndAnotherWall) {
  for (std::uint32_t room = 2; room < 8; ++room) {
    EXPECT_FALSE(verify(view(1, pose(0, {0, 0, 0})), view(room, pose(0, {0, 0, 0})), {})) << room;
  }
  EXPECT_FALSE(verify(view(1, pose(0, {0, 0, 0})), view(1, pose(2.5, {0, 0, 0})), {}));
}

TEST_P(PlaceTest, EachRuleOfVerificationRefusesAlone) {
  const DescribedPlace a = view(1, pose(0.1, {0.2, 0.1, -0.5})), b = view(1, pose(-0.05, {-0.1, 0, -0.2}));
  VerificationReport report;
  ASSERT_TRUE(verify(a, b, {}, &report));
  VerificationOptions options;
  options.min_inliers = report.inliers + 1;
  EXPECT_FALSE(verify(a, b, options)) << "inliers";
  options = {};
  options.min_hypothesis = report.ransac_inliers + 1;
  EXPECT_FALSE(verify(a, b, options)) << "matches that agree";
  options = {};
  options.min_in_half = report.inliers / 2 + 1;
  EXPECT_FALSE(verify(a, b, options)) << "spread";
  options = {};
  options.min_inlier_share = 1;
  options.max_error_px = 0.2;
  options.min_inliers = 4;
  options.min_in_half = 0;
  EXPECT_FALSE(verify(a, b, options, &report)) << "share";
  EXPECT_GE(report.inliers, 4);
}

/// A third of the corners are turned by more than the camera is: they are others that look and lie alike.
TEST_P(PlaceTest, CornersThatAreTurnedAreOthers) {
  const DescribedPlace a = view(1, pose(0.1, {0.2, 0.1, -0.5}));
  DescribedPlace b = view(1, pose(-0.05, {-0.1, 0, -0.2}));
  VerificationReport all, rest;
  ASSERT_TRUE(verify(a, b, {}, &all));
  for (std::size_t j = 0; j < b.corners.size(); j += 3) b.corners[j].angle += 2;
  ASSERT_TRUE(verify(a, b, {}, &rest));
  EXPECT_LT(rest.ransac_inliers, 0.8 * all.ransac_inliers);
  EXPECT_LT(rest.inliers, 0.8 * all.inliers);
  EXPECT_EQ(rest.matches, all.matches);
}

/// A camera that lies on its side sees the same corners, turned by as much.
TEST_P(PlaceTest, ACameraThatRollsSeesThemTurnedAlike) {
  const SE3 T_a_w = pose(0.1, {0.2, 0.1, -0.5});
  const SE3 roll(SO3::exp(Vector3(0, 0, 0.9)), Vector3(0, 0, 0));
  const auto verified = verify(view(1, T_a_w), view(1, roll * T_a_w));
  ASSERT_TRUE(verified);
  EXPECT_LT((verified->T_b_a * roll.inverse()).log().norm(), 0.04);
}

TEST_P(PlaceTest, CornersOfOneSideOfTheImageAreNoLoop) {
  const DescribedPlace a = view(1, pose(0, {0, 0, 0}));
  DescribedPlace b = view(1, pose(0.02, {0.05, 0, 0}));
  ASSERT_TRUE(verify(a, b));
  for (std::size_t j = 0; j < b.corners.size(); ++j) {
    if (b.corners[j].uv.x() > 300) b.corners[j].descriptor = {};
  }
  VerificationReport report;
  EXPECT_FALSE(verify(a, b, {}, &report));
  EXPECT_GE(report.inliers, VerificationOptions().min_inliers);
  EXPECT_FALSE(report.well_spread);
}

/// What the place shows in the left half of its image the camera sees in the middle of its own.
TEST_P(PlaceTest, CornersOfOneSideOfThePlaceAreNoLoop) {
  DescribedPlace a = view(1, pose(0, {0, 0, 0}));
  const DescribedPlace b = view(1, pose(0.3, {0, 0, 0}));
  ASSERT_TRUE(verify(a, b));
  for (DescribedCorner& corner : a.corners) {
    if (corner.uv.x() > 310) corner.descriptor = {};
  }
  VerificationReport report;
  EXPECT_FALSE(verify(a, b, {}, &report));
  EXPECT_GE(report.inliers, VerificationOptions().min_inliers);
  EXPECT_FALSE(report.well_spread);
}

/// Half of the corners are missing in the place's own view; its neighbour has them.
TEST_P(PlaceTest, NeighboursLendTheirCorners) {
  const SE3 T_a_w = pose(0.1, {0.2, 0.1, -0.5}), T_n_w = pose(0.12, {0.25, 0.1, -0.5});
  DescribedPlace a = view(1, T_a_w);
  const DescribedPlace n = view(1, T_n_w), b = view(1, pose(-0.05, {-0.1, 0, -0.2}));
  for (std::size_t i = 0; i < a.corners.size(); i += 2) a.pixels[i].z() = static_cast<float>(Rig::kNoRight);
  VerificationReport alone, together;
  (void)verify(a, b, {}, &alone);
  const std::array<PlacedView, 2> place{{{&a, SE3()}, {&n, T_n_w * T_a_w.inverse()}}};
  ASSERT_TRUE(verify_place(rig_, place, b, {}, &together));
  EXPECT_EQ(together.matches, alone.matches);
  EXPECT_GT(together.inliers, 1.3 * alone.inliers);
}

/// Of a view with the other's corners and depths: each match is right, until something is said of it.
class MatchRuleTest : public PlaceTest {
 protected:
  DescribedPlace a_ = view(1, pose(0.1, {0.2, 0.1, -0.5}));
  DescribedPlace b_ = a_;

  VerificationReport report(const VerificationOptions& options = {}) {
    VerificationReport report;
    (void)verify(a_, b_, options, &report);
    return report;
  }
};

TEST_P(MatchRuleTest, MatchesHaveDepthInBothViews) {
  const VerificationReport all = report();
  for (DescribedPlace* side : {&a_, &b_}) {
    const std::vector<StereoPixelF> kept = side->pixels;
    for (std::size_t i = 0; i < side->pixels.size(); i += 2)
      side->pixels[i].z() = static_cast<float>(Rig::kNoRight);
    EXPECT_LT(report().matches, 0.7 * all.matches);
    for (std::size_t i = 0; i < side->pixels.size(); i += 2)
      side->pixels[i].z() = side->pixels[i].x() - 0.5F;  // far away
    EXPECT_LT(report().matches, 0.7 * all.matches);
    const bool of_place = side == &a_;
    EXPECT_LT(report().guided, (of_place ? 0.7 : 1.1) * all.guided);
    side->pixels = kept;
  }
}

/// No two corners look alike but those of a match, and half of these differ by 64 bits.
TEST_P(MatchRuleTest, MatchesAreNearEachOther) {
  SplitMix64 random(6);
  for (std::size_t i = 0; i < a_.corners.size(); ++i) {
    for (std::uint64_t& bits : a_.corners[i].descriptor.bits) bits = random.next();
    b_.corners[i].descriptor = a_.corners[i].descriptor;
  }
  const int all = report().matches;
  for (std::size_t j = 0; j < b_.corners.size(); j += 2) b_.corners[j].descriptor.bits[0] ^= ~0ULL;
  EXPECT_LT(report().matches, 0.7 * all);
  VerificationOptions farther;
  farther.max_distance = 64;
  EXPECT_GT(report(farther).matches, 0.95 * all);
}

/// Every second corner of b looks as the one before it does, and belongs to no corner of a.
TEST_P(MatchRuleTest, ACornerIsMatchedOnce) {
  const int all = report().matches;
  for (std::size_t j = 1; j < b_.corners.size(); j += 2)
    b_.corners[j].descriptor = b_.corners[j - 1].descriptor;
  const VerificationReport rest = report();
  EXPECT_LT(rest.matches, 0.7 * all);
  EXPECT_LE(rest.guided, static_cast<int>(b_.corners.size()));
  const std::array<PlacedView, 2> twice{{{&a_, SE3()}, {&a_, SE3()}}};
  VerificationReport together;
  b_ = a_;
  ASSERT_TRUE(verify_place(rig_, twice, b_, {}, &together));
  EXPECT_LE(together.guided, static_cast<int>(b_.corners.size()));
  EXPECT_EQ(together.guided, report().guided);
}

/// Points of b at twice their depth: no motion keeps lengths, although each of them is where it was in the
/// left image.
TEST_P(MatchRuleTest, ATriangleOfAnotherSizeIsNoHypothesis) {
  for (StereoPixelF& z : b_.pixels) z.z() = z.x() - 0.5F * (z.x() - z.z());
  VerificationOptions anything;
  anything.max_stretch = 0.9;
  anything.ransac_error_px = 60;
  ASSERT_GT(report(anything).ransac_inliers, 20);
  anything.max_stretch = VerificationOptions().max_stretch;
  EXPECT_EQ(report(anything).ransac_inliers, 0);
}

/// In guided matching, too, a corner that looks otherwise is another, and one that is turned.
TEST_P(MatchRuleTest, GuidedMatchesLookAlikeAndAreTurnedAlike) {
  const int all = report().guided;
  const std::vector<DescribedCorner> kept = b_.corners;
  for (std::size_t j = 0; j < kept.size(); j += 3) b_.corners[j].descriptor.bits = {~0ULL, 0, ~0ULL, 0};
  EXPECT_LT(report().guided, 0.8 * all);
  b_.corners = kept;
  for (std::size_t j = 0; j < kept.size(); j += 3) b_.corners[j].angle += 2;
  EXPECT_LT(report().guided, 0.8 * all);
}

/// Depths of half of b's corners are unknown: where they are in the left image is what speaks for them.
TEST_P(MatchRuleTest, CornersWithoutDepthCountByTheirPlaceInTheImage) {
  const int all = report().inliers;
  for (std::size_t j = 0; j < b_.pixels.size(); j += 2) b_.pixels[j].z() = static_cast<float>(Rig::kNoRight);
  EXPECT_GT(report().inliers, 0.9 * all);
}

TEST_P(MatchRuleTest, AViewWhoseCornersHaveNoPositionsIsNoPlace) {
  ASSERT_TRUE(verify(a_, b_));
  for (DescribedPlace* side : {&a_, &b_}) {
    const std::vector<StereoPixelF> kept = side->pixels;
    side->pixels.pop_back();
    EXPECT_FALSE(verify(a_, b_));
    side->pixels = kept;
  }
  EXPECT_FALSE(verify_place(rig_, {}, b_, {}));
}

TEST_P(MatchRuleTest, OnlyAPlaceThatMayBeTheRightOneIsAskedForItsNeighbours) {
  int asked = 0;
  const PlacedView own{&a_, SE3()};
  const auto place = [&] {
    ++asked;
    return std::span(&own, 1);
  };
  EXPECT_FALSE(verify_place(rig_, a_, place, view(2, SE3()), {}));
  EXPECT_EQ(asked, 0);
  EXPECT_TRUE(verify_place(rig_, a_, place, b_, {}));
  EXPECT_EQ(asked, 1);
}

/// A lost camera that knows no depths: five directions agree with a pose of their own whatever they are, so
/// that a sixth must speak for it.
TEST_P(MatchRuleTest, FiveDirectionsAloneAreNoHypothesis) {
  DescribedPlace b = view(1, pose(-0.05, {-0.1, 0, -0.2}));
  for (StereoPixelF& z : b.pixels) z.z() = static_cast<float>(Rig::kNoRight);
  rig_.kind = SensorKind::kMono;
  VerificationOptions options;
  options.min_inliers = 4;
  options.min_in_half = 0;
  options.min_inlier_share = 0;
  const auto try_some = [&](std::size_t count) {
    VerificationReport report;
    for (std::size_t first = 0; first + count <= b.corners.size(); ++first) {
      const auto from = static_cast<std::ptrdiff_t>(first), to = from + static_cast<std::ptrdiff_t>(count);
      b_.corners.assign(b.corners.begin() + from, b.corners.begin() + to);
      b_.pixels.assign(b.pixels.begin() + from, b.pixels.begin() + to);
      (void)verify(a_, b_, options, &report);
      if (report.ransac_inliers == static_cast<int>(count)) break;
    }
    return report;
  };
  const VerificationReport five = try_some(5), six = try_some(6);
  ASSERT_EQ(five.ransac_inliers, 5);
  EXPECT_EQ(five.guided, 0);
  ASSERT_EQ(six.ransac_inliers, 6);
  EXPECT_GT(six.guided, 0);
}

INSTANTIATE_TEST_SUITE_P(Sensors, MatchRuleTest, ::testing::Values(SensorKind::kStereo, SensorKind::kRgbd));

TEST_P(PlaceTest, LooksMoreLikeItselfThanLikeAnyOther) {
  const DescribedPlace here = view(1, pose(0, {0, 0, 0}));
  const double same = bag_score(here.bag, view(1, pose(0.08, {0.1, 0, 0.2})).bag);
  for (std::uint32_t room = 2; room < 6; ++room) {
    EXPECT_GT(same, 1.5 * bag_score(here.bag, view(room, pose(0, {0, 0, 0})).bag)) << room;
  }
}

INSTANTIATE_TEST_SUITE_P(Sensors, PlaceTest, ::testing::Values(SensorKind::kStereo, SensorKind::kRgbd));

}  // namespace
}  // namespace twofold
