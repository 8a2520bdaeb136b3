#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "fixtures/rendered_scene.hpp"
#include "graph/graph_writer.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "loopclosure/loop_closer.hpp"

namespace twofold {
namespace {

using testing::RenderedScene;
using testing::test_rig;

SE3 pose(double yaw, const Vector3& x_w) {
  const SO3 R_c_w = SO3::exp(Vector3(0, yaw, 0));
  return SE3(R_c_w, -(R_c_w * x_w));
}

std::shared_ptr<const Vocabulary> vocabulary() {
  static const auto kVocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  return kVocabulary;
}

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

/// A camera that turns once around itself in a room and a bit more: keyframes joined one to the next.
class LoopCloserTest : public ::testing::Test {
 protected:
  static constexpr int kTurn = 30;  // keyframes a turn
  Rig rig_ = test_rig(SensorKind::kRgbd, 320, 240);
  GraphWriter writer_;
  GraphSnapshot graph_;

  static SE3 truth(int k) { return pose(2 * M_PI * k / kTurn, {0.2 * std::sin(0.4 * k), 0, 0}); }

  static LoopCloserOptions options() {
    LoopCloserOptions options;
    options.recogniser.near_keyframes = 12;
    return options;
  }

  KeyframeProposal keyframe(int k, std::uint32_t room = 1) {
    RenderedScene scene(rig_, Vector3(3, 2, 4), room);
    KeyframeProposal proposal;
    proposal.id = KeyframeId{static_cast<std::uint32_t>(k)};
    scene.render(truth(k), 1.5, proposal.images);
    return proposal;
  }

  void add_to_map(int k) {
    Keyframe added;
    added.id = KeyframeId{static_cast<std::uint32_t>(k)};
    added.T_k_w = truth(k);
    writer_.add_keyframe(added);
    writer_.set_reference(added.id);
    if (k > 0) {
      Edge edge;
      edge.other = KeyframeId{static_cast<std::uint32_t>(k - 1)};
      edge.weight = 50;
      writer_.set_edge(added.id, edge);
    }
    graph_ = writer_.publish();
  }
};

TEST_F(LoopCloserTest, ClosesTheLoopWhenTheCameraComesBackAndNotBefore) {
  LoopCloser closer(rig_, vocabulary(), options());
  int loops = 0;
  for (int k = 0; k < kTurn + 6; ++k) {
    add_to_map(k);
    const auto loop = closer.step(keyframe(k), graph_);
    if (!loop) continue;
    ++loops;
    EXPECT_GE(k, kTurn - 3);
    EXPECT_EQ(loop->snapshot_version, graph_.version());
    EXPECT_EQ(index(loop->to), static_cast<std::uint32_t>(k));
    const SE3 T_to_from = truth(k) * truth(static_cast<int>(index(loop->from))).inverse();
    EXPECT_LT((loop->T_to_from * T_to_from.inverse()).log().norm(), 0.06);
  }
  EXPECT_GE(loops, 2);
}

TEST_F(LoopCloserTest, OneLikenessAloneIsNotEnough) {
  LoopCloserOptions strict = options();
  strict.recogniser.consistency = 100;
  LoopCloser closer(rig_, vocabulary(), strict);
  for (int k = 0; k < kTurn + 4; ++k) {
    add_to_map(k);
    EXPECT_FALSE(closer.step(keyframe(k), graph_));
  }
}

TEST_F(LoopCloserTest, NeighboursAreNoLoops) {
  LoopCloserOptions wide = options();
  wide.recogniser.near_keyframes = 1000;  // the whole map is near
  LoopCloser closer(rig_, vocabulary(), wide);
  for (int k = 0; k < kTurn + 4; ++k) {
    add_to_map(k);
    EXPECT_FALSE(closer.step(keyframe(k), graph_));
  }
}

TEST_F(LoopCloserTest, RelocalisesInTheMapAndNotElsewhere) {
  LoopCloser closer(rig_, vocabulary(), options());
  for (int k = 0; k < kTurn; ++k) {
    add_to_map(k);
    (void)closer.step(keyframe(k), graph_);
  }
  for (int i = 0; i < 10; ++i) {
    const SE3 T_c_w = pose(0.6 * i + 0.03, {0.1, 0.05, 0.1});
    RenderedScene scene(rig_, Vector3(3, 2, 4), 1);
    FrameImages images;
    scene.render(T_c_w, 1.5, images);
    const auto found = closer.relocalise(images, graph_);
    ASSERT_TRUE(found) << i;
    const SE3 T_c_w_found = found->T_c_k * graph_.T_k_w(found->keyframe);
    EXPECT_LT((T_c_w_found * T_c_w.inverse()).log().norm(), 0.06) << i;
    RenderedScene elsewhere(rig_, Vector3(3, 2, 4), 100 + static_cast<std::uint32_t>(i));
    elsewhere.render(T_c_w, 1.5, images);
    EXPECT_FALSE(closer.relocalise(images, graph_)) << i;
  }
}

TEST_F(LoopCloserTest, CulledKeyframesAreForgotten) {
  LoopCloser closer(rig_, vocabulary(), options());
  for (int k = 0; k < 6; ++k) {
    add_to_map(k);
    (void)closer.step(keyframe(k), graph_);
  }
  const KeyframeProposal old = keyframe(1);
  ASSERT_TRUE(closer.relocalise(old.images, graph_));
  for (std::uint32_t k = 0; k < 5; ++k) writer_.cull_keyframe(KeyframeId{k}, KeyframeId{5});
  graph_ = writer_.publish();
  add_to_map(6);
  (void)closer.step(keyframe(6), graph_);
  const auto found = closer.relocalise(old.images, graph_);
  if (found) {
    EXPECT_GE(index(found->keyframe), 5U);
  }
}

TEST(LoopCloserOptions, NameWhatIsWrong) {
  LoopCloserOptions options;
  EXPECT_EQ(options.invalid_reason(), "");
  options.verification.min_inliers = 3;
  EXPECT_NE(options.invalid_reason().find("min_inliers"), std::string::npos);
}

}  // namespace
}  // namespace twofold
