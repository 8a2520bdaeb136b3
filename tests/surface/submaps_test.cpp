#include "surface/submaps.hpp"

#include <gtest/gtest.h>

#include "surface/meshing.hpp"
#include "tests/graph/graph_pieces.hpp"
#include "tests/surface/ball_views.hpp"

namespace twofold {
namespace {

using testing::Ball;

/// A camera around a ball: the map's keyframes and what they see.
class SubmapSurfaceTest : public ::testing::Test {
 protected:
  static constexpr int kKeyframes = 12;

  explicit SubmapSurfaceTest() : rig_(testing::depth_rig()) {}

  void add_keyframe(SubmapSurface& surface) {
    const auto n = static_cast<int>(writer_.graph().keyframe_count());
    const SE3 T_k_w = testing::camera_around(n, kKeyframes);
    Keyframe keyframe;
    keyframe.id = KeyframeId{static_cast<std::uint32_t>(n)};
    keyframe.frame_index = 10 * (n - loaded_);
    keyframe.T_k_w = T_k_w;
    keyframe.median_depth = 0.7;
    writer_.add_keyframe(keyframe);
    if (n > 0) {
      writer_.set_edge(keyframe.id, testing::edge_to(KeyframeId{static_cast<std::uint32_t>(n - 1)}, 50));
      writer_.set_reference(keyframe.id);
    }
    if (n >= loaded_) surface.offer(depth_of_keyframe(n));
  }
  [[nodiscard]] KeyframeDepth depth_of_keyframe(int n) const {
    cv::Mat depth;
    testing::depth_of(rig_, testing::camera_around(n, kKeyframes), ball_)
        .convertTo(depth, CV_16U, 1 / rig_.depth_unit);
    return pack_keyframe_depth(10 * (n - loaded_), depth, {});
  }
  void add_all(SubmapSurface& surface) {
    for (int n = 0; n < kKeyframes; ++n) {
      add_keyframe(surface);
      surface.step(writer_.publish());
    }
  }
  /// Mean distance of the mesh from the ball, moved by T.
  [[nodiscard]] double error(const SubmapSurface& surface, const SE3& T_w_moved = SE3()) const {
    const TriangleMesh mesh = extract_mesh(surface.whole(KeyframeId{0}));
    EXPECT_GT(mesh.positions.size(), 500u);
    double sum = 0;
    for (const auto& x : mesh.positions)
      sum += std::abs((x.cast<double>() - T_w_moved * ball_.centre).norm() - ball_.radius);
    return sum / std::max<double>(1, static_cast<double>(mesh.positions.size()));
  }

  Rig rig_;
  Ball ball_{{0.02, -0.01, 0.03}, 0.15};
  GraphWriter writer_;
  int loaded_ = 0;  ///< keyframes that the map has from another run, whose frames were counted likewise
  SubmapOptions limits_{.max_keyframes = 5, .max_waiting = 64, .memory_mb = 500};
};

TEST_F(SubmapSurfaceTest, KeyframesShareSubmapsAndMakeOneSurface) {
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  add_all(surface);
  EXPECT_EQ(surface.submap_count(), 3u);
  EXPECT_EQ(surface.report().fused, kKeyframes);
  EXPECT_EQ(surface.report().fused_anew, 0);
  EXPECT_LT(error(surface), 0.002);
}

TEST_F(SubmapSurfaceTest, ALoopMovesSubmapsWithoutFusingAnew) {
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  add_all(surface);
  const SE3 T_new_old(SO3::exp(Vector3(0.1, 0.2, -0.1)), Vector3(0.3, -0.2, 0.5));
  for (std::uint32_t k = 0; k < kKeyframes; ++k)
    writer_.set_pose(KeyframeId{k}, writer_.graph().keyframe(KeyframeId{k}).T_k_w * T_new_old.inverse());
  surface.step(writer_.publish());
  EXPECT_EQ(surface.report().fused_anew, 0);
  EXPECT_LT(error(surface, T_new_old), 0.002);
}

TEST_F(SubmapSurfaceTest, SubmapsBeginOnTheWorldsGrid) {
  const SurfaceOptions options = testing::fine_options();
  SubmapSurface surface(rig_, options, limits_);
  add_all(surface);
  const std::vector<PlacedVolume> placed = surface.placed(KeyframeId{0});
  ASSERT_EQ(placed.size(), 3u);
  for (const PlacedVolume& submap : placed)
    EXPECT_TRUE(shift_in_blocks(submap.T_w_v, kBlockEdge * options.voxel)) << submap.T_w_v.matrix();
}

TEST_F(SubmapSurfaceTest, OnlyABentGroupIsFusedAnew) {
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  add_all(surface);
  // The second keyframe of the first submap moves by more than half a voxel, one of the second by less.
  const auto shift = [&](std::uint32_t k, double by) {
    const SE3 T_k_w = writer_.graph().keyframe(KeyframeId{k}).T_k_w;
    writer_.set_pose(KeyframeId{k}, SE3(SO3(), Vector3(by, 0, 0)) * T_k_w);
  };
  shift(1, 0.008);
  shift(6, 0.002);
  surface.step(writer_.publish());
  EXPECT_EQ(surface.report().fused_anew, limits_.max_keyframes);
  surface.step(writer_.publish());
  EXPECT_EQ(surface.report().fused_anew, limits_.max_keyframes);
}

TEST_F(SubmapSurfaceTest, BentGroupsMoveAtOnceAndAreFusedAnewInPiecesMostBentFirst) {
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  add_all(surface);
  // Everything moves, the last keyframe of the first submap 8 mm further, one of the second 20 mm.
  const SE3 T_new_old(SO3(), Vector3(0.3, -0.2, 0.5));
  for (std::uint32_t k = 0; k < kKeyframes; ++k) {
    const double further = k == 4 ? 0.008 : k == 6 ? 0.02 : 0.0;
    const SE3 T_k_w = writer_.graph().keyframe(KeyframeId{k}).T_k_w * T_new_old.inverse();
    writer_.set_pose(KeyframeId{k}, SE3(SO3(), Vector3(further, 0, 0)) * T_k_w);
  }
  const GraphSnapshot& graph = writer_.publish();
  surface.step(graph, {.anew = 0});
  EXPECT_EQ(surface.bent(), 2u);
  EXPECT_EQ(surface.report().fused_anew, 0);
  EXPECT_LT(error(surface, T_new_old), 0.002);  // as it was, elsewhere
  const auto cleared = [&](std::size_t n) { return surface.placed(KeyframeId{0})[n].volume->cleared(); };
  surface.step(graph, {.anew = 3});
  EXPECT_EQ(surface.bent(), 2u);
  EXPECT_EQ(cleared(1), 0u) << "half of it was seen";
  surface.step(graph, {.anew = 3});
  EXPECT_EQ(surface.report().fused_anew, 6);
  EXPECT_EQ(surface.bent(), 1u);
  EXPECT_EQ(cleared(0), 0u);
  EXPECT_GT(cleared(1), 0u);
  surface.step(graph, {.anew = 4});
  EXPECT_EQ(surface.bent(), 0u);
  EXPECT_GT(cleared(0), 0u);
  surface.step(graph, {.anew = 1});
  EXPECT_EQ(surface.report().fused_anew, 2 * limits_.max_keyframes);
}

TEST_F(SubmapSurfaceTest, KeyframesThatComeWhileTheirSubmapIsFusedAnewAreInItBeforeAndAfter) {
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  const auto fuse_next = [&] {
    add_keyframe(surface);
    surface.step(writer_.publish(), {.anew = 0});
  };
  for (int n = 0; n < 3; ++n) fuse_next();
  const SE3 T_k_w = writer_.graph().keyframe(KeyframeId{1}).T_k_w;
  writer_.set_pose(KeyframeId{1}, SE3(SO3(), Vector3(0.008, 0, 0)) * T_k_w);
  surface.step(writer_.publish(), {.anew = 1});
  ASSERT_EQ(surface.bent(), 1u);
  const auto volume = [&] { return surface.placed(KeyframeId{0})[0].volume; };
  const std::uint64_t before = volume()->revision();
  fuse_next();
  EXPECT_GT(volume()->revision(), before) << "not seen until the others are fused anew";
  const std::uint64_t revision = volume()->revision();
  surface.step(writer_.publish(), {.anew = 3});
  EXPECT_EQ(surface.bent(), 0u);
  EXPECT_GT(volume()->cleared(), revision) << "whoever knew the one before has to begin anew";
  SubmapSurface at_once(rig_, testing::fine_options(), limits_);
  for (int n = 0; n < 4; ++n) at_once.offer(depth_of_keyframe(n));
  at_once.step(writer_.publish());
  EXPECT_TRUE(extract_mesh(*volume()) == extract_mesh(*at_once.placed(KeyframeId{0})[0].volume));
}

TEST_F(SubmapSurfaceTest, AStepDoesAsMuchAsItIsAllowedAndSaysWhetherAnythingIsLeft) {
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  for (int n = 0; n < 5; ++n) add_keyframe(surface);
  const GraphSnapshot& graph = writer_.publish();
  for (const int fused : {0, 2, 4, 5}) {
    surface.step(graph, {.keyframes = fused == 0 ? 0U : 2U});
    EXPECT_EQ(surface.report().fused, fused);
    EXPECT_EQ(surface.unfinished(), fused < 5);
  }
  surface.offer(depth_of_keyframe(5));  // not in the map yet: nothing to do
  surface.step(graph, {.keyframes = 2});
  EXPECT_FALSE(surface.unfinished());
}

TEST_F(SubmapSurfaceTest, WhatIsSharedStaysAsItIs) {
  limits_.free_space = true;
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  for (int n = 0; n < 7; ++n) {
    add_keyframe(surface);
    surface.step(writer_.publish());
  }
  const std::vector<SharedSubmap> shared = surface.share();
  ASSERT_EQ(shared.size(), 2u);
  EXPECT_EQ(shared[0].volume.get(), surface.placed(KeyframeId{0})[0].volume)
      << "copied, though nobody changes it";
  const std::uint64_t revision = shared[1].volume->revision();
  const TriangleMesh mesh = extract_mesh(*shared[1].volume);
  add_keyframe(surface);
  surface.step(writer_.publish());
  EXPECT_EQ(shared[1].volume->revision(), revision);
  EXPECT_TRUE(extract_mesh(*shared[1].volume) == mesh);
  EXPECT_GT(surface.placed(KeyframeId{0})[1].volume->revision(), revision);
  EXPECT_EQ(shared[0].volume.get(), surface.placed(KeyframeId{0})[0].volume);
  EXPECT_GT(shared[0].free->bytes(), 0u);
}

TEST_F(SubmapSurfaceTest, WhatIsSharedIsNotCopiedToBeFusedAnew) {
  limits_.free_space = true;
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  add_all(surface);
  const std::vector<SharedSubmap> shared = surface.share();
  const std::uint64_t revision = shared[0].volume->revision();
  const SE3 T_k_w = writer_.graph().keyframe(KeyframeId{1}).T_k_w;
  writer_.set_pose(KeyframeId{1}, SE3(SO3(), Vector3(0.008, 0, 0)) * T_k_w);
  surface.step(writer_.publish());
  EXPECT_EQ(shared[0].volume->revision(), revision);
  const SurfaceVolume& anew = *surface.placed(KeyframeId{0})[0].volume;
  EXPECT_NE(&anew, shared[0].volume.get());
  EXPECT_GT(anew.cleared(), revision) << "whoever compares revisions has to begin anew";
}

TEST_F(SubmapSurfaceTest, FreeSpaceIsKeptForThoseWhoAskOnly) {
  SubmapSurface without(rig_, testing::fine_options(), limits_);
  add_all(without);
  const std::vector<SharedSubmap> shared = without.share();
  ASSERT_EQ(shared.size(), 3u);
  for (const SharedSubmap& submap : shared) EXPECT_EQ(submap.free, nullptr);
}

/// Two keyframes that look along z at a wall, in one submap, and one that a ball hides part of it from, in
/// another.
class HiddenSpaceTest : public SubmapSurfaceTest {
 protected:
  HiddenSpaceTest() {
    limits_.free_space = true;
    ball_ = {{0, 0, 1.8}, 0.3};
  }
  /// @param before  the keyframe whose submap it goes to; kNoKeyframe: one of its own
  void look_at_wall(SubmapSurface& surface, const Ball& ball, KeyframeId before) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{static_cast<std::uint32_t>(writer_.graph().keyframe_count())};
    keyframe.frame_index = 10 * static_cast<std::int64_t>(index(keyframe.id));
    keyframe.median_depth = 3;
    writer_.add_keyframe(keyframe);
    if (before != kNoKeyframe) writer_.set_edge(keyframe.id, testing::edge_to(before, 50));
    cv::Mat depth;
    testing::depth_of(rig_, SE3(), ball, 3).convertTo(depth, CV_16U, 1 / rig_.depth_unit);
    surface.offer(pack_keyframe_depth(keyframe.frame_index, depth, {}));
    surface.step(writer_.publish());
  }
  /// Whether the first submap has the cell of a position in the world free.
  [[nodiscard]] static bool is_free(SubmapSurface& surface, const Vector3& x_w) {
    const SharedSubmap first = surface.share().front();
    const Eigen::Vector3i cell = (first.T_w_s.inverse() * x_w / (4 * kVoxel)).array().floor().cast<int>();
    return first.free->contains({cell.x(), cell.y(), cell.z()});
  }
  /// Keyframe `n` of it moves by more than half a voxel.
  void bend_first_submap(SubmapSurface& surface, std::uint32_t n) {
    writer_.set_pose(KeyframeId{n}, SE3(SO3(), Vector3(0.6 * kVoxel, 0, 0)));
    const int before = surface.report().fused_anew;
    surface.step(writer_.publish());
    ASSERT_EQ(surface.report().fused_anew, before + 2);
  }

  static constexpr double kVoxel = 0.02;
  const Ball nowhere_{{0, 0, 100}, 0.1};
  const Vector3 behind_{0.01, 0.01, 2.3}, aside_{0.6, 0.01, 2.3};
};

TEST_F(HiddenSpaceTest, WhatALaterImageHidStaysHiddenWhereASubmapIsFusedAnew) {
  SubmapSurface surface(rig_, testing::fine_options(kVoxel), limits_);
  look_at_wall(surface, nowhere_, kNoKeyframe);
  look_at_wall(surface, nowhere_, KeyframeId{0});
  ASSERT_TRUE(is_free(surface, behind_) && is_free(surface, aside_));
  look_at_wall(surface, ball_, kNoKeyframe);
  ASSERT_EQ(surface.submap_count(), 2u);
  ASSERT_FALSE(is_free(surface, behind_));
  bend_first_submap(surface, 1);
  EXPECT_FALSE(is_free(surface, behind_));
  EXPECT_TRUE(is_free(surface, aside_));
}

TEST_F(HiddenSpaceTest, WhatWasSeenThroughAgainStaysFreeWhereASubmapIsFusedAnew) {
  SubmapSurface surface(rig_, testing::fine_options(kVoxel), limits_);
  look_at_wall(surface, nowhere_, kNoKeyframe);
  look_at_wall(surface, ball_, kNoKeyframe);
  ASSERT_FALSE(is_free(surface, behind_));
  look_at_wall(surface, nowhere_, KeyframeId{0});
  ASSERT_TRUE(is_free(surface, behind_));
  bend_first_submap(surface, 2);
  EXPECT_TRUE(is_free(surface, behind_));
}

TEST_F(SubmapSurfaceTest, CulledKeyframesLeaveWhatTheyAdded) {
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  add_all(surface);
  const std::size_t before = surface.bytes();
  writer_.cull_keyframe(KeyframeId{0}, KeyframeId{1});  // the first submap hangs on it
  writer_.cull_keyframe(KeyframeId{2}, KeyframeId{1});
  surface.step(writer_.publish());
  EXPECT_EQ(surface.report().culled, 2);
  EXPECT_LT(surface.bytes(), before);
  EXPECT_LT(error(surface), 0.002);
  for (const std::uint32_t k : {1U, 3U, 4U}) writer_.cull_keyframe(KeyframeId{k}, KeyframeId{5});
  surface.step(writer_.publish());
  EXPECT_EQ(surface.report().submaps_dropped, 1);
  EXPECT_EQ(surface.submap_count(), 2u);
}

TEST_F(SubmapSurfaceTest, DepthMayComeAfterTheKeyframe) {
  SubmapSurface early(rig_, testing::fine_options(), limits_);
  SubmapSurface late(rig_, testing::fine_options(), limits_);
  for (int n = 0; n < kKeyframes; ++n) {
    add_keyframe(early);
    const GraphSnapshot& graph = writer_.publish();
    early.step(graph);
    late.step(graph);
    if (n % 3 != 2) continue;  // of three at once
    for (int m = n - 2; m <= n; ++m) late.offer(depth_of_keyframe(m));
    late.step(graph);
  }
  EXPECT_EQ(late.report().fused, kKeyframes);
  EXPECT_EQ(late.report().not_in_map, 0);
  EXPECT_LT(error(late), 0.002);
}

TEST_F(SubmapSurfaceTest, KeyframesOfALoadedMapGetNoDepth) {
  for (int n = 0; n < 3; ++n) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{static_cast<std::uint32_t>(n)};
    keyframe.frame_index = 20 * n;
    keyframe.T_k_w = SE3(SO3(), Vector3(5, 0, 0));
    writer_.add_keyframe(keyframe);
  }
  loaded_ = 3;
  limits_.first_keyframe = 3;
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  while (writer_.graph().keyframe_count() < kKeyframes) {
    add_keyframe(surface);
    surface.step(writer_.publish());
  }
  EXPECT_EQ(surface.report().fused, kKeyframes - loaded_);
  EXPECT_EQ(surface.report().not_in_map, 0);
  EXPECT_LT(error(surface), 0.002);
}

TEST_F(SubmapSurfaceTest, MemoryIsBounded) {
  limits_.memory_mb = 1;
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  add_all(surface);
  EXPECT_GT(surface.report().beyond_memory, 0);
  EXPECT_LT(static_cast<double>(surface.report().most_bytes), 4e6);
}

TEST_F(SubmapSurfaceTest, ImagesWithoutReadingsAreNotFused) {
  ball_.centre = {0, 0, 100};
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  add_all(surface);
  EXPECT_EQ(surface.report().fused, 0);
  EXPECT_EQ(surface.report().without_readings, kKeyframes);
}

TEST_F(SubmapSurfaceTest, FramesThatNeverBecomeKeyframesAreLetGoOf) {
  limits_.max_waiting = 3;
  SubmapSurface surface(rig_, testing::fine_options(), limits_);
  const cv::Mat depth(240, 320, CV_16UC1, cv::Scalar(1000));
  for (int n = 0; n < 8; ++n) surface.offer(pack_keyframe_depth(-100 + n, depth, {}));
  EXPECT_EQ(surface.waiting(), 3u);
  EXPECT_EQ(surface.report().overtaken, 5);
  add_keyframe(surface);
  surface.step(writer_.publish());
  EXPECT_EQ(surface.waiting(), 0u);
  EXPECT_EQ(surface.report().not_in_map, 2);
  EXPECT_EQ(surface.report().fused, 1);
}

}  // namespace
}  // namespace twofold
