#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "loopclosure/geometric_verification.hpp"
#include "loopclosure/place_view.hpp"
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

  PlaceView view(std::uint32_t room, const SE3& T_c_w) {
    RenderedScene scene(rig_, Vector3(3, 2, 4), room);
    FrameImages images;
    scene.render(T_c_w, 2.0, images);
    return describer_.describe(images, *vocabulary());
  }
};

TEST_P(PlaceTest, DescribesManyCornersSpreadOverTheImageWithTheirDepth) {
  const SE3 T_c_w = pose(0.2, {0.3, 0, 0});
  const PlaceView place = view(1, T_c_w);
  ASSERT_EQ(place.z.size(), place.corners.size());
  EXPECT_GT(place.corners.size(), 300U);
  EXPECT_LE(place.corners.size(), 500U);
  std::map<int, int> quadrants;
  const RenderedScene scene(rig_, Vector3(3, 2, 4), 1);
  int right = 0, with_depth = 0;
  for (std::size_t i = 0; i < place.corners.size(); ++i) {
    const Vector2 uv = place.corners[i].uv.cast<double>();
    ++quadrants[(uv.x() < 320 ? 0 : 1) + (uv.y() < 240 ? 0 : 2)];
    if (!std::isfinite(place.z[i].z())) continue;
    ++with_depth;
    const double disparity = rig_.disparity_from_depth(scene.depth(T_c_w, uv));
    right += std::abs(uv.x() - place.z[i].z() - disparity) < 1.0 ? 1 : 0;
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
  const auto verified = verify_place(rig_, view(1, T_a_w), view(1, T_b_w), {}, &report);
  ASSERT_TRUE(verified) << report.matches << " matches, " << report.ransac_inliers << " in RANSAC, "
                        << report.inliers << " of " << report.guided << " guided";
  const Vector6 error = (verified->T_b_a * (T_b_w * T_a_w.inverse()).inverse()).log();
  EXPECT_LT(error.head<3>().norm(), 0.03);
  EXPECT_LT(error.tail<3>().norm(), 0.01);
  EXPECT_GE(verified->inliers, VerificationOptions().min_inliers);
}

TEST_P(PlaceTest, RejectsAnotherRoomAndAnotherWall) {
  for (std::uint32_t room = 2; room < 8; ++room) {
    EXPECT_FALSE(verify_place(rig_, view(1, pose(0, {0, 0, 0})), view(room, pose(0, {0, 0, 0})), {})) << room;
  }
  EXPECT_FALSE(verify_place(rig_, view(1, pose(0, {0, 0, 0})), view(1, pose(2.5, {0, 0, 0})), {}));
}

TEST_P(PlaceTest, LooksMoreLikeItselfThanLikeAnyOther) {
  const PlaceView here = view(1, pose(0, {0, 0, 0}));
  const double same = bag_score(here.bag, view(1, pose(0.08, {0.1, 0, 0.2})).bag);
  for (std::uint32_t room = 2; room < 6; ++room) {
    EXPECT_GT(same, 1.5 * bag_score(here.bag, view(room, pose(0, {0, 0, 0})).bag)) << room;
  }
}

INSTANTIATE_TEST_SUITE_P(Sensors, PlaceTest, ::testing::Values(SensorKind::kStereo, SensorKind::kRgbd));

}  // namespace
}  // namespace twofold
