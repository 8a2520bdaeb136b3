#include "mapping/insertion.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "mapping/culling.hpp"
#include "mapping/mapper.hpp"
#include "tests/mapping/small_graphs.hpp"

namespace twofold {
namespace {

Rig depth_camera() {
  Rig rig;
  rig.kind = SensorKind::kRgbd;
  rig.camera = {400, 400, 320, 240, 640, 480};
  rig.baseline = 0.1;
  return rig;
}

/// A keyframe without points, as a depth camera before bare walls proposes it.
KeyframeProposal measured(std::uint32_t id, std::uint32_t reference, double sigma_m, double sigma_rad) {
  KeyframeProposal proposal;
  proposal.id = KeyframeId{id};
  proposal.reference = KeyframeId{reference};
  proposal.T_k_ref = SE3::exp((Vector6() << 0.1, -0.02, 0.05, 0.01, 0.03, -0.02).finished());
  proposal.median_depth = 2;
  proposal.pose_information.diagonal() << Vector3::Constant(1 / (sigma_m * sigma_m)),
      Vector3::Constant(1 / (sigma_rad * sigma_rad));
  return proposal;
}

/// Four keyframes in a row, and a proposal that hangs on the last one.
class InsertionTest : public testing::Test {
 protected:
  InsertionTest() {
    for (std::uint32_t k = 0; k < 4; ++k) consistent_.set(k, 0);
    proposal_.id = KeyframeId{4};
    proposal_.reference = KeyframeId{3};
    proposal_.T_k_ref = SE3(SO3(), {-0.1, 0, 0});
  }

  InsertionReport insert() { return insert_keyframe(writer_, proposal_, 15, consistent_, counts_); }
  /// The proposed keyframe sees so many points that `observers` see.
  void share(int count, const std::vector<KeyframeId>& observers) {
    for (int n = 0; n < count; ++n) {
      const Vector3 x_w(0.01 * n, 0.05, 1);
      see(add_point(writer_, rig_, x_w, observers), x_w);
    }
  }
  void see(PointId id, const Vector3& x_w) {
    const SE3 T_k_w = proposal_.T_k_ref * writer_.graph().T_k_w(proposal_.reference);
    Observation observation;
    observation.point = id;
    observation.pixel = rig_.project(T_k_w * x_w).cast<float>();
    proposal_.observations.push_back(observation);
  }
  /// A point that was started in keyframe `anchor` and found again.
  void start(std::uint32_t id, std::uint32_t anchor) {
    const Vector3 x_w(0.1, 0.01 * id, 1);
    const Vector3 x_a = writer_.graph().T_k_w(KeyframeId{anchor}) * x_w;
    Observation at_anchor;
    at_anchor.pixel = rig_.project(x_a).cast<float>();
    proposal_.points.push_back({PointId{id}, KeyframeId{anchor}, to_inverse_depth(x_a), at_anchor, {}});
    see(PointId{id}, x_w);
  }
  [[nodiscard]] const Edge* edge_to(std::uint32_t other) const {
    return find_edge(writer_.graph().keyframe(proposal_.id), KeyframeId{other});
  }

  const Rig rig_ = depth_camera();
  GraphWriter writer_ = chain(4);
  KeyframeProposal proposal_;
  IdMap consistent_, counts_;
};

TEST_F(InsertionTest, NewPointsJoinWhenTheyWereMeasuredTwiceAndTheirAnchorIsThere) {
  remove_keyframe(writer_, KeyframeId{1});
  start(0, 1);  // its anchor was culled meanwhile
  start(1, 2);
  proposal_.points.back().psi.z() = -1;  // behind the camera
  start(2, 2);
  proposal_.observations.back().pixel.x() = std::numeric_limits<float>::quiet_NaN();
  start(3, 2);
  proposal_.observations.pop_back();  // not found again
  start(4, 2);
  const InsertionReport report = insert();
  EXPECT_EQ(report.new_points, 1);
  for (std::uint32_t p = 0; p < 4; ++p) {
    EXPECT_FALSE(writer_.graph().contains(PointId{p}) && !writer_.graph().point(PointId{p}).culled()) << p;
  }
  EXPECT_EQ(*writer_.graph().point(PointId{4}).observers, (ObserverList{KeyframeId{2}, proposal_.id}));
  EXPECT_EQ(report.observations, 1);
  EXPECT_EQ(report.dropped_observations, 3);
}

TEST_F(InsertionTest, WhatWasNotMeasuredIsDropped) {
  share(3, {KeyframeId{2}, KeyframeId{3}});
  proposal_.observations[1].pixel.y() = std::numeric_limits<float>::quiet_NaN();
  writer_.cull_point(PointId{2});
  const InsertionReport report = insert();
  EXPECT_EQ(report.observations, 1);
  EXPECT_EQ(report.dropped_observations, 2);
  EXPECT_EQ(writer_.graph().keyframe(proposal_.id).observations->size(), 1U);
}

TEST_F(InsertionTest, WhatHangsOnAnotherPartIsDropped) {
  share(2, {KeyframeId{0}});
  share(1, {KeyframeId{2}});
  start(3, 0);
  start(4, 2);
  writer_.set_part(KeyframeId{0}, KeyframeId{0});
  for (std::uint32_t k = 1; k < 4; ++k) writer_.set_part(KeyframeId{k}, KeyframeId{1});
  const InsertionReport report = insert();
  EXPECT_EQ(report.new_points, 1);
  EXPECT_EQ(report.observations, 2);
  EXPECT_EQ(report.dropped_observations, 3);
}

TEST_F(InsertionTest, EdgesJoinKeyframesThatShareEnoughPoints) {
  share(14, {KeyframeId{0}});
  share(15, {KeyframeId{1}});
  EXPECT_EQ(insert().edges, 1);
  EXPECT_EQ(edge_to(0), nullptr);
  ASSERT_NE(edge_to(1), nullptr);
  EXPECT_EQ(edge_to(1)->weight, 15);
  EXPECT_EQ(edge_to(3), nullptr) << "the reference shares none";
}

TEST_F(InsertionTest, TheStrongestWillDoWhereNoneSharesEnough) {
  share(5, {KeyframeId{0}});
  share(9, {KeyframeId{1}});
  EXPECT_EQ(insert().edges, 1);
  ASSERT_NE(edge_to(1), nullptr);
  EXPECT_EQ(edge_to(1)->weight, 9);
}

TEST_F(InsertionTest, TheReferenceWillDoWhereNoneSharesAny) {
  EXPECT_EQ(insert().edges, 1);
  ASSERT_NE(edge_to(3), nullptr);
}

/// Poses that do not agree with one another, as across a loop that is not closed yet, are not joined.
TEST_F(InsertionTest, NoEdgesToKeyframesWhosePosesAreNotKnownToAgree) {
  share(20, {KeyframeId{0}});
  share(20, {KeyframeId{3}});
  consistent_.clear();
  consistent_.set(3, 0);
  EXPECT_EQ(insert().edges, 1);
  EXPECT_EQ(edge_to(0), nullptr);
  EXPECT_NE(edge_to(3), nullptr);
}

TEST_F(InsertionTest, AReferenceFromElsewhereBeginsTheSetAnew) {
  share(20, {KeyframeId{0}});
  consistent_.clear();
  consistent_.set(0, 0);
  EXPECT_EQ(insert().edges, 1);
  EXPECT_EQ(edge_to(0), nullptr);
  EXPECT_NE(edge_to(3), nullptr);
  EXPECT_FALSE(consistent_.contains(KeyframeId{0}));
  EXPECT_TRUE(consistent_.contains(KeyframeId{3}));
  EXPECT_TRUE(consistent_.contains(KeyframeId{4}));
}

/// A window around the newest of six keyframes in a row, which is all of its inner window. Keyframe 0 shares
/// points with others, to which it has no edge.
class RegistrationTest : public testing::Test {
 protected:
  RegistrationTest() {
    share(20, 3);
    share(14, 4);
    share(20, 5);
  }
  void share(int count, std::uint32_t other) {
    for (int n = 0; n < count; ++n)
      add_point(writer_, rig_, {0.01 * n, 0.05, 1}, {KeyframeId{0}, KeyframeId{other}});
  }
  int register_first(int outer_window) {
    MapperOptions options;
    options.inner_window = 1;
    options.outer_window = outer_window;
    options.max_anchors = 0;
    SelectionScratch scratch;
    DoubleWindow window;
    select_double_window(writer_.graph(), options, scratch, window);
    IdMap counts;
    return register_in_window(writer_, KeyframeId{0}, window, 15, counts);
  }
  [[nodiscard]] const Edge* edge_to(std::uint32_t other) const {
    return find_edge(writer_.graph().keyframe(KeyframeId{0}), KeyframeId{other});
  }

  const Rig rig_ = depth_camera();
  GraphWriter writer_ = chain(6);
};

TEST_F(RegistrationTest, JoinsWhoSharesEnoughPointsByPoseWhereNeitherIsOptimisedWithItsPoints) {
  EXPECT_EQ(register_first(5), 2);
  ASSERT_NE(edge_to(3), nullptr);
  EXPECT_TRUE(edge_to(3)->marginalised);
  EXPECT_NEAR(edge_to(3)->T_other_this.translation().x(), -0.3, 1e-9);
  EXPECT_EQ(edge_to(4), nullptr) << "14 points are too few";
  ASSERT_NE(edge_to(5), nullptr);
  EXPECT_FALSE(edge_to(5)->marginalised);
}

TEST_F(RegistrationTest, WhoIsNotInTheWindowWaits) {
  EXPECT_EQ(register_first(4), 0);
  EXPECT_EQ(edge_to(5), nullptr);
}

TEST_F(InsertionTest, APoseThatWasMeasuredIsNoConstraintWherePointsTieTheTwo) {
  share(15, {KeyframeId{2}, KeyframeId{3}});
  proposal_.pose_information.setIdentity();
  insert();
  EXPECT_FALSE(keep_measured_pose(writer_, proposal_, rig_, {}));
  ASSERT_NE(edge_to(3), nullptr);
  EXPECT_FALSE(edge_to(3)->marginalised);
}

TEST(MeasuredPose, StaysInTheMapAsAnEdgeWithAConstraint) {
  const Rig rig = depth_camera();
  Mapper mapper(rig, {});
  mapper.continue_from(chain(3).publish());
  for (std::uint32_t id = 3; id < 9; ++id) {
    KeyframeProposal proposal = measured(id, id - 1, 0.001, 0.0005);
    KeyframeProposal* pointer = &proposal;
    mapper.step(std::span(&pointer, 1));
    const Edge* edge = find_edge(mapper.graph().keyframe(KeyframeId{id}), KeyframeId{id - 1});
    ASSERT_NE(edge, nullptr) << id;
    EXPECT_TRUE(edge->marginalised) << id;
    EXPECT_LT((edge->T_other_this * proposal.T_k_ref).log().norm(), 1e-12) << id;
    const SE3 T_k_ref =
        mapper.graph().T_k_w(KeyframeId{id}) * mapper.graph().T_k_w(KeyframeId{id - 1}).inverse();
    EXPECT_LT((T_k_ref * proposal.T_k_ref.inverse()).log().norm(), 1e-6) << id;
  }
}

TEST(MeasuredPose, WeighsAsMuchAsItsWorstDirection) {
  Keyframe from, to;
  from.median_depth = to.median_depth = 2;
  const Rig rig = depth_camera();
  const EdgeInformationOptions options;
  Edge edge;
  edge.weight = 40;
  Matrix6 information = edge_information(from, to, edge, rig, options);
  information(2, 2) *= 0.5;
  EXPECT_NEAR(weight_of_measured_pose(information, from, to, rig, options), 20, 1);
  information(2, 2) *= 1e-6;
  EXPECT_EQ(weight_of_measured_pose(information, from, to, rig, options), 1);
}

}  // namespace
}  // namespace twofold
