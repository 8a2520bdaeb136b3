#include "surface/mesh_pieces.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <random>
#include <vector>

#include "surface/composition.hpp"
#include "surface/meshing.hpp"
#include "tests/surface/ball_views.hpp"

namespace twofold {
namespace {

using testing::Ball;

/// A ball before a wall, from views that a random walk takes.
class RandomViews {
 public:
  explicit RandomViews(unsigned seed) : random_(seed) {}

  void fuse_next(SurfaceVolume& volume) {
    std::uniform_real_distribution<double> uniform(-1, 1);
    const auto vector = [&](double by) {
      return Vector3(by * uniform(random_), by * uniform(random_), by * uniform(random_));
    };
    const SE3 T_c_w = SE3(SO3::exp(vector(0.2)), vector(0.1)) * SE3(SO3(), {0, 0, 0.8});
    const Ball ball{vector(0.1), 0.1};
    volume.fuse(make_depth_view(rig_, testing::depth_of(rig_, T_c_w, ball, 1.1), {}), T_c_w);
  }
  void fuse_ball(SurfaceVolume& volume, const Ball& ball) const {
    const SE3 T_c_w(SO3(), {0, 0, 0.8});
    volume.fuse(make_depth_view(rig_, testing::depth_of(rig_, T_c_w, ball), {}), T_c_w);
  }

 private:
  Rig rig_ = testing::depth_rig(160, 120);
  std::mt19937 random_;
};

SurfaceOptions options() {
  SurfaceOptions coarse = testing::fine_options(0.02);
  coarse.min_triangles = 8;
  return coarse;
}

TEST(MeshPieces, AfterAnyFusionAreTheMeshOfTheWhole) {
  SurfaceVolume volume(options());
  MeshPieces pieces;
  RandomViews views(1);
  for (int n = 0; n < 12; ++n) {
    if (n == 7) volume.clear();
    views.fuse_next(volume);
    pieces.update(volume);
    const TriangleMesh whole = extract_mesh(volume);
    ASSERT_GT(whole.triangles.size(), 500u);
    ASSERT_TRUE(pieces.joined(volume.options().min_triangles) == whole) << n;
  }
}

TEST(MeshPieces, OfBlocksThatDidNotChangeStay) {
  SurfaceVolume volume(testing::fine_options(0.01));
  const RandomViews views(1);
  views.fuse_ball(volume, {{-0.2, 0, 0}, 0.15});
  MeshPieces pieces;
  const std::size_t first = pieces.update(volume);
  const std::uint64_t revision = pieces.revision();
  const std::size_t blocks = pieces.changed_since(0).size();
  EXPECT_EQ(pieces.update(volume), 0u);
  EXPECT_EQ(pieces.revision(), revision);
  views.fuse_ball(volume, {{0.2, 0, 0}, 0.04});
  EXPECT_LT(pieces.update(volume), first);
  const std::vector<BlockPosition> changed = pieces.changed_since(revision);
  EXPECT_FALSE(changed.empty());
  for (const BlockPosition& at : changed) EXPECT_GE(at.x, 0);
  EXPECT_EQ(pieces.changed_since(0).size(), blocks + changed.size());
  EXPECT_TRUE(pieces.changed_since(pieces.revision()).empty());
}

TEST(MeshPieces, ThatGoAreToldAsEmpty) {
  SurfaceVolume volume(options());
  const RandomViews views(1);
  views.fuse_ball(volume, {{0, 0, 0}, 0.1});
  MeshPieces pieces;
  pieces.update(volume);
  const std::vector<BlockPosition> before = pieces.changed_since(0);
  const std::uint64_t revision = pieces.revision();
  volume.clear();
  pieces.update(volume);
  EXPECT_EQ(pieces.changed_since(revision), before);
  EXPECT_TRUE(pieces.changed_since(0).empty());  // of pieces that nobody has
  for (const BlockPosition& at : before) EXPECT_TRUE(pieces.piece(at).triangles.empty());
  EXPECT_TRUE(pieces.joined(0).positions.empty());
}

using Corners = std::array<std::array<float, 3>, 3>;
void add_corners(const TriangleMesh& mesh, std::vector<Corners>& all) {
  for (const auto& t : mesh.triangles) {
    Corners corners;
    for (std::size_t i = 0; i < 3; ++i) {
      ASSERT_LT(t[i], mesh.positions.size());
      corners[i] = {mesh.positions[t[i]].x(), mesh.positions[t[i]].y(), mesh.positions[t[i]].z()};
    }
    all.push_back(corners);
  }
}

TEST(MeshPieces, OneByOneHaveAllTriangles) {
  SurfaceVolume volume(options());
  RandomViews views(2);
  for (int n = 0; n < 3; ++n) views.fuse_next(volume);
  MeshPieces pieces;
  pieces.update(volume);
  std::vector<Corners> of_pieces, of_whole;
  for (const BlockPosition& at : pieces.changed_since(0)) add_corners(pieces.piece(at), of_pieces);
  add_corners(pieces.joined(0), of_whole);
  std::sort(of_pieces.begin(), of_pieces.end());
  std::sort(of_whole.begin(), of_whole.end());
  EXPECT_GT(of_whole.size(), 500u);
  EXPECT_TRUE(of_pieces == of_whole);
}

class CompositionTest : public ::testing::Test {
 protected:
  CompositionTest() {
    for (int n = 0; n < 3; ++n) {
      volumes_.emplace_back(options());
      views_.fuse_next(volumes_.back());
    }
    for (std::uint32_t n = 0; n < 3; ++n)
      placed_.push_back({n, &volumes_[n], SE3(SO3::exp(Vector3(0.1 * n, 0.2, -0.1)), {0.03 * n, 0, 0.01})});
  }
  [[nodiscard]] TriangleMesh mesh_of_all() const {
    SurfaceVolume whole(options());
    for (const PlacedVolume& placed : placed_) whole.add(*placed.volume, placed.T_w_v);
    return extract_mesh(whole);
  }
  void expect_same(const char* after) {
    composition_.settle(placed_);
    const TriangleMesh mesh = mesh_of_all();
    EXPECT_TRUE(composition_.mesh().joined(options().min_triangles) == mesh) << after;
    EXPECT_TRUE(extract_mesh(composition_.whole()) == mesh) << after;
  }
  void move(std::size_t n, double by) { placed_[n].T_w_v = SE3(SO3(), {0, by, 0}) * placed_[n].T_w_v; }

  RandomViews views_{3};
  std::deque<SurfaceVolume> volumes_;
  std::vector<PlacedVolume> placed_;
  Composition composition_{options()};
};

TEST_F(CompositionTest, IsTheSumOfItsVolumesWhateverHappens) {
  expect_same("adding");
  views_.fuse_next(volumes_[1]);
  expect_same("fusing");
  move(0, 0.3);
  views_.fuse_next(volumes_[2]);
  expect_same("moving");
  volumes_[1].clear();
  views_.fuse_next(volumes_[1]);
  expect_same("fusing anew");
  placed_.erase(placed_.begin());
  expect_same("removing");
  volumes_.emplace_back(options());
  views_.fuse_next(volumes_.back());
  placed_.push_back({7, &volumes_.back(), SE3()});
  move(0, 1e-6);
  expect_same("a hair's breadth and another volume");
}

TEST_F(CompositionTest, FollowsOnlyWhatMovesByHalfAVoxel) {
  EXPECT_GT(composition_.update(placed_), 0u);
  const std::uint64_t revision = composition_.mesh().revision();
  move(1, 0.4 * options().voxel);
  EXPECT_EQ(composition_.update(placed_), 0u);
  EXPECT_EQ(composition_.mesh().revision(), revision);
  move(1, 0.4 * options().voxel);
  EXPECT_GT(composition_.update(placed_), 0u);
  EXPECT_TRUE(composition_.mesh().joined(options().min_triangles) == mesh_of_all());
}

TEST_F(CompositionTest, WhatMayRestIsJoinedAnewOnDemandIfItMovedByHalfAVoxel) {
  Composition patient(options(), 2);
  patient.update(placed_);
  std::vector<PlacedVolume> now = placed_;
  move(0, 1.0 * options().voxel);
  move(1, 0.4 * options().voxel);
  move(2, 1.5 * options().voxel);
  EXPECT_EQ(patient.update(placed_), 0u);
  ASSERT_TRUE(patient.rejoin(placed_));
  EXPECT_GT(patient.update(placed_), 0u);
  now[0] = placed_[0];
  now[2] = placed_[2];
  Composition wanted(options());
  wanted.update(now);
  EXPECT_TRUE(patient.mesh().joined(0) == wanted.mesh().joined(0));
  EXPECT_FALSE(patient.rejoin(placed_)) << "less than half a voxel";
  move(1, 2.0 * options().voxel);
  EXPECT_GT(patient.update(placed_), 0u) << "more than may rest";
}

TEST_F(CompositionTest, KeepsNoBlocksWhereNothingIsAnyMore) {
  composition_.update(placed_);
  const std::size_t once = composition_.whole().blocks().size();
  for (int n = 0; n < 30; ++n) {
    for (std::size_t i = 0; i < 3; ++i) move(i, 5);
    composition_.update(placed_);
  }
  EXPECT_LT(composition_.whole().blocks().size(), 4 * once + 2000);
  expect_same("wandering");
}

TEST_F(CompositionTest, FollowsAVolumeThatHadNothingYet) {
  volumes_.emplace_back(options());
  placed_.push_back({3, &volumes_.back(), SE3()});
  composition_.update(placed_);
  move(3, 0.3);
  views_.fuse_next(volumes_.back());
  composition_.update(placed_);
  EXPECT_TRUE(composition_.mesh().joined(options().min_triangles) == mesh_of_all());
}

TEST_F(CompositionTest, WhatMovedIsMadeAnewAFewBlocksAtATime) {
  const std::size_t all = composition_.update(placed_);
  ASSERT_GT(all, 200u);
  for (std::size_t n = 0; n < 3; ++n) move(n, 0.3);
  EXPECT_EQ(composition_.update(placed_, 100), 100u);
  EXPECT_TRUE(composition_.unfinished());
  move(2, -0.1);
  // Whoever shows pieces asks for those that changed, and has all as they are.
  std::map<BlockPosition, TriangleMesh> shown;
  std::uint64_t revision = 0;
  std::size_t updates = 0;
  for (; composition_.unfinished(); ++updates) {
    EXPECT_LE(composition_.update(placed_, 100), 100u);
    const MeshPieces& mesh = composition_.mesh();
    for (const BlockPosition& at : mesh.changed_since(revision)) shown[at] = mesh.piece(at);
    revision = mesh.revision();
    for (const BlockPosition& at : mesh.changed_since(0)) ASSERT_TRUE(shown[at] == mesh.piece(at));
  }
  EXPECT_GT(updates, all / 100 - 1);
  EXPECT_TRUE(composition_.mesh().joined(options().min_triangles) == mesh_of_all());
}

TEST_F(CompositionTest, WhatIsNewOvertakesWhatMoved) {
  composition_.update(placed_);
  for (std::size_t n = 0; n < 3; ++n) move(n, 0.3);
  composition_.update(placed_, 0);
  ASSERT_TRUE(composition_.unfinished());
  volumes_.emplace_back(options());
  views_.fuse_ball(volumes_.back(), {{0, 0, 0}, 0.1});
  placed_.push_back({7, &volumes_.back(), SE3(SO3(), Vector3(5, 0, 0))});  // alone
  composition_.update(placed_, 0);
  const std::uint64_t wanted = composition_.of_new().marked;
  while (composition_.of_new().made < wanted) EXPECT_LE(composition_.update(placed_, 40), 40u);
  EXPECT_LT(composition_.of_moved().made, composition_.of_moved().marked);
  const TriangleMesh mesh = composition_.mesh().joined(0);
  SurfaceVolume ball(options());
  ball.add(volumes_.back(), placed_.back().T_w_v);
  const auto far = [](const Eigen::Vector3f& x) { return x.x() > 3; };
  EXPECT_EQ(static_cast<std::size_t>(std::count_if(mesh.positions.begin(), mesh.positions.end(), far)),
            extract_mesh(ball).positions.size());
  EXPECT_TRUE(composition_.unfinished());
  composition_.update(placed_);
  EXPECT_TRUE(composition_.mesh().joined(options().min_triangles) == mesh_of_all());
}

/// A camera looks at what others see, too, and what they say is not asked for each time.
TEST_F(CompositionTest, IsTheSumOfItsVolumesWhicheverOfThemChange) {
  std::mt19937 random(5);
  for (int n = 0; n < 5; ++n) {
    volumes_.emplace_back(options());
    views_.fuse_next(volumes_.back());
    placed_.push_back({static_cast<std::uint32_t>(3 + n), &volumes_.back(),
                       SE3(SO3::exp(Vector3(0.02 * n, 0, 0.1)), {0, 0.02 * n, 0})});
  }
  for (int n = 0; n < 60; ++n) {
    const std::size_t changed = std::uniform_int_distribution<std::size_t>(0, volumes_.size() - 1)(random);
    const std::size_t what = std::uniform_int_distribution<std::size_t>(0, 9)(random);
    if (what == 0) move(changed, 0.1);
    if (what == 1) volumes_[changed].clear();
    if (what == 2 && placed_.size() > 5) placed_.erase(placed_.begin());
    if (what > 2) views_.fuse_next(volumes_[changed]);
    composition_.update(placed_, n % 3 == 0 ? 100 : Composition::kAll);
    if (n % 10 == 9) expect_same("whatever");
  }
}

/// Distance of a mesh's vertices, one of many, from where others stand, at most.
double farthest(const TriangleMesh& mesh, const TriangleMesh& others) {
  double most = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); v += 23) {
    float nearest = std::numeric_limits<float>::infinity();
    for (const Eigen::Vector3f& y : others.positions)
      nearest = std::min(nearest, (mesh.positions[v] - y).squaredNorm());
    most = std::max<double>(most, std::sqrt(nearest));
  }
  return most;
}

double longest_edge(const TriangleMesh& mesh) {
  double most = 0;
  for (const auto& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i)
      most = std::max<double>(most, (mesh.positions[t[i]] - mesh.positions[t[(i + 1) % 3]]).norm());
  return most;
}

TEST_F(CompositionTest, TheMeshMovesWithItsVolumesUntilItIsMadeAnew) {
  composition_.update(placed_);
  const TriangleMesh before = composition_.mesh().joined(0);
  const std::uint64_t revision = composition_.mesh().revision();
  const SE3 T_new_old(SO3::exp(Vector3(0.02, 0.3, -0.1)), Vector3(0.3, -0.2, 0.5));
  for (PlacedVolume& volume : placed_) volume.T_w_v = T_new_old * volume.T_w_v;
  composition_.update(placed_, 0);
  const TriangleMesh moved = composition_.mesh().joined(0);
  ASSERT_TRUE(moved.triangles == before.triangles);
  EXPECT_EQ(composition_.mesh().changed_since(revision), composition_.mesh().changed_since(0));
  for (std::size_t v = 0; v < moved.positions.size(); ++v) {
    const Vector3 at = T_new_old * before.positions[v].cast<double>();
    ASSERT_LT((moved.positions[v].cast<double>() - at).norm(), 1e-5);
    ASSERT_LT(
        (moved.normals[v].cast<double>() - T_new_old.rotation() * before.normals[v].cast<double>()).norm(),
        1e-5);
  }
  composition_.update(placed_, 0);
  EXPECT_TRUE(composition_.mesh().joined(0) == moved) << "moved twice";
  // By turns: all that is drawn is near where the surface is in the end.
  Composition in_the_end(options());
  in_the_end.update(placed_);
  const TriangleMesh wanted = in_the_end.mesh().joined(0);
  for (int n = 0; n < 3; ++n) {
    composition_.update(placed_, 150);
    ASSERT_TRUE(composition_.unfinished());
    const TriangleMesh between = composition_.mesh().joined(0);
    EXPECT_GT(between.triangles.size(), wanted.triangles.size() / 2);
    // Resampled, rims of what was seen end up to two samples earlier, along each axis.
    EXPECT_LT(farthest(between, wanted), 2 * std::sqrt(3) * options().voxel);
    EXPECT_LT(longest_edge(between), 3 * options().voxel);
  }
  composition_.update(placed_);
  EXPECT_TRUE(composition_.mesh().joined(0) == wanted);
}

TEST_F(CompositionTest, ASecondMoveTakesAlongWhatIsNotMadeAnewYet) {
  composition_.update(placed_);
  const TriangleMesh before = composition_.mesh().joined(0);
  for (const double by : {0.3, -0.1}) {
    for (std::size_t n = 0; n < 3; ++n) move(n, by);
    composition_.update(placed_, 0);
  }
  const TriangleMesh moved = composition_.mesh().joined(0);
  ASSERT_EQ(moved.positions.size(), before.positions.size());
  for (std::size_t v = 0; v < moved.positions.size(); ++v)
    ASSERT_LT((moved.positions[v] - before.positions[v] - Eigen::Vector3f(0, 0.2f, 0)).norm(), 1e-5);
  composition_.update(placed_);
  EXPECT_TRUE(composition_.mesh().joined(options().min_triangles) == mesh_of_all());
}

TEST_F(CompositionTest, AMoveTakesAlongWhatWasToBeJoinedAnewForAnother) {
  composition_.update(placed_);
  const TriangleMesh before = composition_.mesh().joined(0);
  for (std::size_t n = 0; n < 3; ++n) move(n, 0.02);
  ASSERT_TRUE(composition_.rejoin(placed_));
  for (std::size_t n = 0; n < 3; ++n) move(n, 0.3);
  ASSERT_TRUE(composition_.rejoin(placed_));
  const TriangleMesh moved = composition_.mesh().joined(0);
  ASSERT_EQ(moved.positions.size(), before.positions.size());
  for (std::size_t v = 0; v < moved.positions.size(); ++v)
    ASSERT_LT((moved.positions[v] - before.positions[v] - Eigen::Vector3f(0, 0.32f, 0)).norm(), 1e-5);
}

TEST_F(CompositionTest, KeepsItsMeshAndItsPlaceInTheQueuesWhereAllMovesAtOnce) {
  SurfaceOptions fine = options();
  fine.voxel = 0.005;
  std::deque<SurfaceVolume> volumes;
  std::vector<PlacedVolume> placed;
  for (std::uint32_t n = 0; n < 3; ++n) {
    volumes.emplace_back(fine);
    views_.fuse_next(volumes.back());
    placed.push_back({n, &volumes.back(), SE3(SO3::exp(Vector3(0.1 * n, 0.2, -0.1)), {0.03 * n, 0, 0.01})});
  }
  Composition composition(fine, 2);
  ASSERT_GT(composition.update(placed), 2000u);
  const std::size_t triangles = composition.mesh().joined(0).triangles.size();
  for (PlacedVolume& volume : placed) volume.T_w_v = SE3(SO3(), {0, 0.3, 0}) * volume.T_w_v;
  ASSERT_TRUE(composition.rejoin(placed));
  const Composition::Progress before = composition.of_moved();
  composition.update(placed, 100);
  EXPECT_EQ(composition.whole().cleared(), 0u);
  EXPECT_EQ(composition.of_moved().marked, before.marked);
  EXPECT_EQ(composition.of_moved().made, before.made + 100);
  EXPECT_GT(composition.mesh().joined(0).triangles.size(), triangles * 9 / 10);
}

TEST_F(CompositionTest, AVolumeMovesByWhatItHoldsNow) {
  placed_.resize(1);
  placed_[0].T_w_v = SE3();
  volumes_[0] = SurfaceVolume(options());
  views_.fuse_ball(volumes_[0], {{0, 0, 0}, 0.1});
  composition_.update(placed_);
  const SE3 T_turned(SO3::exp(Vector3(0, 0.02, 0)), Vector3::Zero());  // less than half a voxel at the ball
  const Rig rig = testing::depth_rig(160, 120);
  const SE3 T_c_v(SO3(), {0, 0, 0.8});
  volumes_[0].fuse(make_depth_view(rig, testing::depth_of(rig, T_c_v, {{0, 0, 0}, 0.1}, 2.5), {}), T_c_v);
  placed_[0].T_w_v = T_turned;
  composition_.update(placed_);
  EXPECT_TRUE(composition_.mesh().joined(options().min_triangles) == mesh_of_all());
}

TEST_F(CompositionTest, OnlyTheMeshOfAVolumeThatMovedMoves) {
  placed_[2].T_w_v = SE3(SO3(), {5, 0, 0});  // alone
  composition_.update(placed_);
  const TriangleMesh before = composition_.mesh().joined(0);
  move(2, 0.3);
  composition_.update(placed_, 0);
  const TriangleMesh moved = composition_.mesh().joined(0);
  std::size_t far = 0;
  for (std::size_t v = 0; v < moved.positions.size(); ++v) {
    const bool is_of_moved = before.positions[v].x() > 3;
    far += is_of_moved;
    ASSERT_NEAR((moved.positions[v] - before.positions[v]).norm(), is_of_moved ? 0.3 : 0, 1e-5);
  }
  EXPECT_GT(far, 100u);
  EXPECT_LT(far, moved.positions.size());
}

TEST_F(CompositionTest, VolumesThatOverlapMoveTheirMeshBetweenThem) {
  for (PlacedVolume& volume : placed_) volume.T_w_v = SE3();
  composition_.update(placed_);
  const TriangleMesh before = composition_.mesh().joined(0);
  move(0, 0.3);
  composition_.update(placed_, 0);
  const TriangleMesh moved = composition_.mesh().joined(0);
  std::size_t between = 0;
  for (std::size_t v = 0; v < moved.positions.size(); ++v) {
    const float by = (moved.positions[v] - before.positions[v]).y();
    ASSERT_GE(by, -1e-5f);
    ASSERT_LE(by, 0.3f + 1e-5f);
    between += by > 0.05f && by < 0.25f;
  }
  EXPECT_GT(between, 100u);
}

/// 0 where nothing was ever seen.
std::uint16_t weight_of_nearest_sample(const SurfaceVolume& volume, const Vector3& x_v) {
  const Eigen::Vector3i g = (x_v / volume.options().voxel).array().round().cast<int>();
  const VoxelBlock* block = volume.blocks().find({g.x() >> 3, g.y() >> 3, g.z() >> 3});
  return block == nullptr
             ? std::uint16_t{0}
             : block->weight[static_cast<std::size_t>(((g.z() & 7) * 8 + (g.y() & 7)) * 8 + (g.x() & 7))];
}

TEST(Resampler, ReadsBetweenTheSamples) {
  SurfaceVolume volume(testing::fine_options(0.02));
  RandomViews views(4);
  for (int n = 0; n < 2; ++n) views.fuse_next(volume);
  const SE3 T_w_v(SO3::exp(Vector3(0.3, -0.5, 0.7)), {0.11, -0.23, 0.05});
  SurfaceVolume turned(testing::fine_options(0.02));
  turned.add(volume, T_w_v);
  std::size_t seen = 0, at_rims = 0;
  for (const VoxelBlock* block : turned.blocks().sorted()) {
    for (int i = 0; i < kBlockSamples; ++i) {
      const Vector3 grid =
          Eigen::Vector3i(8 * block->at.x + i % 8, 8 * block->at.y + i / 8 % 8, 8 * block->at.z + i / 64)
              .cast<double>();
      const Vector3 x_v = T_w_v.inverse() * Vector3(0.02 * grid);
      const auto expected = volume.distance(x_v);
      const auto s = static_cast<std::size_t>(i);
      // Where two are as near, either may be meant.
      const Vector3 between = x_v / 0.02 - (x_v / 0.02).array().floor().matrix();
      if (((between.array() - 0.5).abs() < 1e-4).any()) continue;
      EXPECT_EQ(block->weight[s], weight_of_nearest_sample(volume, x_v));
      if (block->weight[s] == 0) continue;
      ++(expected ? seen : at_rims);
      if (!expected) continue;
      EXPECT_NEAR(turned.units().distance * block->distance[s], expected->distance,
                  1.1 * turned.units().distance);
    }
  }
  EXPECT_GT(seen, 20000u);
  EXPECT_GT(at_rims, 5000u);
}

/// Submaps move a little with each solution of the map.
TEST(Resampler, LosesNoRimWhenAVolumeMovesALittle) {
  SurfaceVolume volume(testing::fine_options(0.02));
  RandomViews views(4);
  views.fuse_next(volume);
  SurfaceVolume moved(testing::fine_options(0.02));
  moved.add(volume, SE3(SO3::exp(Vector3(1e-4, -1e-4, 1e-4)), {0.002, -0.001, 0.002}));
  const auto seen = [](const SurfaceVolume& of) {
    std::size_t count = 0;
    for (std::size_t b = 0; b < of.blocks().size(); ++b)
      for (std::size_t s = 0; s < kBlockSamples; ++s) count += of.blocks()[b].weight[s] > 0;
    return count;
  };
  ASSERT_GT(seen(volume), 10000u);
  EXPECT_NEAR(static_cast<double>(seen(moved)) / static_cast<double>(seen(volume)), 1, 0.001);
  const double before = static_cast<double>(extract_mesh(volume).triangles.size());
  EXPECT_NEAR(static_cast<double>(extract_mesh(moved).triangles.size()) / before, 1, 0.02);
}

TEST(Resampler, TakesTheSamplesOfAGridThatIsShiftedByBlocks) {
  SurfaceVolume volume(testing::fine_options(0.02));
  RandomViews views(4);
  for (int n = 0; n < 2; ++n) views.fuse_next(volume);
  const double edge = kBlockEdge * 0.02;
  SurfaceVolume shifted(testing::fine_options(0.02));
  shifted.add(volume, SE3(SO3(), edge * Vector3(3, -2, 5)));
  ASSERT_EQ(shifted.blocks().size(), volume.blocks().size());
  for (std::size_t b = 0; b < volume.blocks().size(); ++b) {
    const VoxelBlock& from = volume.blocks()[b];
    const VoxelBlock* block = shifted.blocks().find({from.at.x + 3, from.at.y - 2, from.at.z + 5});
    ASSERT_NE(block, nullptr);
    EXPECT_EQ(block->distance, from.distance);
    EXPECT_EQ(block->weight, from.weight);
  }
  const std::size_t triangles = extract_mesh(volume).triangles.size();
  ASSERT_GT(triangles, 1000u);
  EXPECT_EQ(extract_mesh(shifted).triangles.size(), triangles);
  EXPECT_FALSE(shift_in_blocks(SE3(SO3(), Vector3(0.5 * edge, 0, 0)), edge));
  EXPECT_FALSE(shift_in_blocks(SE3(SO3::exp(Vector3(0, 1e-4, 0)), Vector3(edge, 0, 0)), edge));
}

TEST(Resampler, LeavesNothingOut) {
  SurfaceVolume volume(testing::fine_options(0.02));
  RandomViews views(4);
  views.fuse_next(volume);
  SurfaceVolume copy(testing::fine_options(0.02));
  copy.add(volume, SE3());
  std::size_t seen = 0;
  for (const VoxelBlock* block : copy.blocks().sorted()) {
    const VoxelBlock* from = volume.blocks().find(block->at);
    for (std::size_t s = 0; s < kBlockSamples; ++s) seen += block->weight[s] > 0;
    if (from == nullptr) continue;
    for (std::size_t s = 0; s < kBlockSamples; ++s) {
      if (block->weight[s] == 0) continue;
      EXPECT_NEAR(block->distance[s], from->distance[s], 1);
    }
  }
  EXPECT_GT(seen, 10000u);
}

}  // namespace
}  // namespace twofold
