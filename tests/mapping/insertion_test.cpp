#include "mapping/insertion.hpp"

#include <gtest/gtest.h>

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
