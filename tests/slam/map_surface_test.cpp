#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/io/scratch_folder.hpp"
#include "twofold/slam.hpp"
#include "twofold/source.hpp"
#include "twofold/surface.hpp"

namespace twofold {
namespace {

constexpr double kVoxel = 0.03;    // [m]
constexpr double kTruncation = 4;  // [voxels]

/// Whether, as far as this around a vertex, the mesh neither ends nor bends: no rim, no edge, no other thing.
std::vector<bool> plain_vertices(const SurfaceMesh& mesh, double around) {
  constexpr double kBend = 0.9;  // cosine
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : mesh.triangles)
    for (std::size_t a = 0; a < 3; ++a) ++edges[std::minmax(t[a], t[(a + 1) % 3])];
  std::vector<bool> at_border(mesh.positions.size(), false), plain(mesh.positions.size(), true);
  for (const auto& [edge, count] : edges)
    if (count == 1) at_border[edge.first] = at_border[edge.second] = true;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    for (std::size_t w = 0; w < mesh.positions.size() && plain[v]; ++w) {
      double square = 0, cosine = 0;
      for (std::size_t a = 0; a < 3; ++a) {
        const double by = mesh.positions[v][a] - mesh.positions[w][a];
        square += by * by;
        cosine += mesh.normals[v][a] * mesh.normals[w][a];
      }
      if (square < around * around && (at_border[w] || cosine < kBend)) plain[v] = false;
    }
  }
  return plain;
}

/// What a snapshot says beside vertices of its mesh, 1.5 voxels before and 0.7 behind them.
struct BesideCounts {
  int all = 0;
  int free = 0, occupied = 0;  ///< before, and behind: as it is
  int unknown = 0, wrong = 0;  ///< on one side at least
  int near = 0;                ///< the distance a voxel before them is right to half a voxel
};

/// @param plain  of those that plain_vertices says, as far as the truncation; or of the others
BesideCounts count_beside(const SurfaceSnapshot& snapshot, const SurfaceMesh& mesh, bool plain) {
  const std::vector<bool> is_plain = plain_vertices(mesh, kTruncation * kVoxel);
  BesideCounts counts;
  for (std::size_t v = 0; v < mesh.positions.size(); v += 5) {
    if (is_plain[v] != plain) continue;
    const auto beside = [&](double voxels) {
      std::array<double, 3> x{};
      for (std::size_t a = 0; a < 3; ++a) x[a] = mesh.positions[v][a] + voxels * kVoxel * mesh.normals[v][a];
      return snapshot.at(x);
    };
    const SpaceState before = beside(1.5).state, behind = beside(-0.7).state;
    ++counts.all;
    counts.free += before == SpaceState::kFree;
    counts.occupied += behind == SpaceState::kOccupied;
    counts.unknown += before == SpaceState::kUnknown || behind == SpaceState::kUnknown;
    counts.wrong += before == SpaceState::kOccupied || behind == SpaceState::kFree;
    counts.near += std::abs(beside(1).distance - kVoxel) < 0.5 * kVoxel;
  }
  return counts;
}

/// A run over a rendered desk, whose keyframes a surface gets.
class MapSurfaceTest : public ::testing::Test {
 protected:
  static constexpr const char* kScene = "synthetic:desk?sensor=rgbd&width=160&height=120&rounds=1&frames=160";

  /// Until so many keyframes more have been added, or the source ends.
  SurfaceUpdate add_keyframes(int count) {
    for (FrameView frame; count > 0 && source_.next(frame);) {
      slam_.push(frame);
      pose_ = slam_.latest();
      if (!pose_ || !pose_->keyframe) continue;
      surface_.add(frame, pose_->frame);
      --count;
    }
    return surface_.update(slam_.map());
  }
  [[nodiscard]] std::array<double, 3> ahead(double metres) const {
    return transform(pose_->T_world_camera, {0, 0, metres});
  }

  Source source_{kScene};
  Slam slam_{source_.rig(), {.mode = RunMode::kDeterministic}};
  MapSurface surface_{slam_.map(), {.model = {.voxel_size = kVoxel}}};
  std::optional<PoseEstimate> pose_;
  FrameView frame_;
};

TEST_F(MapSurfaceTest, AnswersWhatIsFreeAndWhereTheNextSurfaceIs) {
  add_keyframes(1000);
  const SurfaceSnapshot now = surface_.snapshot();
  EXPECT_EQ(now.map_version(), slam_.map().version());
  EXPECT_EQ(now.map_part(), pose_->map_part);
  const SurfaceMesh mesh = now.mesh();
  const BesideCounts plain = count_beside(now, mesh, true), others = count_beside(now, mesh, false);
  // The surface goes on to all sides as far as the truncation: all is known, and right.
  ASSERT_GT(plain.all, 100);
  EXPECT_EQ(plain.free, plain.all);
  EXPECT_EQ(plain.occupied, plain.all);
  EXPECT_EQ(plain.near, plain.all);
  // Beside rims and edges, and where the next thing is nearer than the truncation, samples end on one side,
  // since nobody looked there; what is known is wrong only where a thing is as thin as a voxel.
  ASSERT_GT(others.all, 100);
  EXPECT_LT(others.unknown, 0.5 * others.all);
  EXPECT_LT(others.wrong, 0.02 * others.all);
  const int all = plain.all + others.all;
  EXPECT_GT(plain.free + others.free, 0.75 * all);
  EXPECT_GT(plain.occupied + others.occupied, 0.75 * all);
  EXPECT_GT(plain.near + others.near, 0.7 * all);
  const auto x = mesh.positions[mesh.positions.size() / 2];
  const DistanceBox box{{x[0] - 0.3, x[1] - 0.3, x[2] - 0.3}, {x[0] + 0.3, x[1] + 0.3, x[2] + 0.3}, 0.05};
  EXPECT_LT(std::abs(now.distances(box).at({x[0], x[1], x[2]}).distance), 0.05);
  EXPECT_EQ(now.at(ahead(0.4)).state, SpaceState::kFree) << "seen through, away from surfaces";
  EXPECT_GT(now.mesh().triangles.size(), 500U);
  EXPECT_GT(now.memory_bytes(), 100'000U);
}

TEST_F(MapSurfaceTest, ASnapshotIsPreparedOnceForAllCopies) {
  SurfaceSnapshot().prepare();
  add_keyframes(2);
  const SurfaceSnapshot prepared = surface_.snapshot(), copy = surface_.snapshot();
  const std::size_t bytes = prepared.memory_bytes();
  prepared.prepare();
  const std::size_t joined = copy.memory_bytes();
  EXPECT_GT(joined, bytes + bytes / 4);
  EXPECT_FALSE(copy.mesh().triangles.empty());
  EXPECT_EQ(copy.memory_bytes(), joined) << "the question has joined nothing";
}

TEST_F(MapSurfaceTest, ASnapshotStaysAsItWas) {
  add_keyframes(2);
  const SurfaceSnapshot early = surface_.snapshot();
  const SurfaceSnapshot same = surface_.snapshot();
  const SurfaceMesh mesh = early.mesh();
  ASSERT_GT(mesh.triangles.size(), 100U);
  add_keyframes(1000);
  EXPECT_TRUE(same.mesh().positions == mesh.positions) << "joined only now";
  EXPECT_GT(surface_.snapshot().mesh().triangles.size(), mesh.triangles.size());
  EXPECT_LT(early.map_version(), surface_.snapshot().map_version());
}

TEST_F(MapSurfaceTest, ReportsWhatItFusedAndWhatItLeftOut) {
  EXPECT_EQ(add_keyframes(1), SurfaceUpdate{.fused = 1});
  EXPECT_EQ(add_keyframes(2).fused, 2);
  EXPECT_EQ(surface_.update(slam_.map()), SurfaceUpdate()) << "nothing is told twice";

  ASSERT_TRUE(source_.next(frame_));
  MapSurface none(slam_.map(), {.model = {.voxel_size = kVoxel}});
  for (int n = 0; n < 66; ++n) none.add(frame_, 1'000'000 + n);
  EXPECT_EQ(none.update(slam_.map()), (SurfaceUpdate{.overtaken = 2, .waiting = 64}));
}

TEST_F(MapSurfaceTest, ReportsFramesThatAreNoKeyframesAndKeyframesBeyondItsMemory) {
  MapSurface small(slam_.map(), {.model = {.voxel_size = kVoxel}, .memory_mb = 0.01});
  int keyframes = 0, others = 0;
  while (keyframes < 3 && source_.next(frame_)) {
    slam_.push(frame_);
    pose_ = slam_.latest();
    ASSERT_TRUE(pose_);
    if (!pose_->keyframe && pose_->frame % 8 != 0) continue;
    (pose_->keyframe ? keyframes : others) += 1;
    small.add(frame_, pose_->frame);
  }
  EXPECT_GT(others, 3);
  EXPECT_EQ(small.update(slam_.map()),
            (SurfaceUpdate{.fused = 1, .beyond_memory = keyframes - 1, .discarded = others}));
}

void expect_near(const Pose& a, const Pose& b, double metres) {
  const Pose between = compose(inverse(a), b);
  EXPECT_LT(std::hypot(between.t[0], between.t[1], between.t[2]), metres);
  EXPECT_LT(std::hypot(between.q[0], between.q[1], between.q[2]), metres);
}

const MapSnapshot::Keyframe& keyframe_of(const std::vector<MapSnapshot::Keyframe>& keyframes,
                                         std::uint32_t id) {
  return *std::find_if(keyframes.begin(), keyframes.end(), [&](const auto& k) { return k.id == id; });
}

/// After a correction the map of before and its surface still belong together.
TEST_F(MapSurfaceTest, ASnapshotSaysWhereTheCameraIsInItsOwnWorld) {
  add_keyframes(3);
  const SurfaceSnapshot early = surface_.snapshot();
  const MapSnapshot early_map = slam_.map();
  const PoseEstimate early_pose = *pose_;
  const auto early_keyframes = early_map.keyframes();
  const Pose expected = compose(keyframe_of(early_keyframes, early_pose.reference_keyframe).T_world_camera,
                                early_pose.T_reference_camera);
  ASSERT_TRUE(early.camera_pose(early_pose));
  expect_near(*early.camera_pose(early_pose), expected, 1e-9);

  add_keyframes(1000);
  ASSERT_GT(pose_->reference_keyframe, early_keyframes.back().id);
  EXPECT_FALSE(early.camera_pose(*pose_)) << "a keyframe that it does not know";
  const auto now = early.camera_pose(*pose_, slam_.map());
  ASSERT_TRUE(now);
  expect_near(*now, pose_->T_world_camera, 0.03);
  EXPECT_EQ(early.camera_pose(early_pose, slam_.map()), early.camera_pose(early_pose));

  PoseEstimate lost = *pose_;
  lost.state = TrackingState::kLost;
  EXPECT_FALSE(early.camera_pose(lost, slam_.map()));
  EXPECT_FALSE(SurfaceSnapshot().camera_pose(*pose_, slam_.map()));
  PoseEstimate unknown = *pose_;
  unknown.reference_keyframe = 1'000'000;
  EXPECT_FALSE(early.camera_pose(unknown, slam_.map()));
}

/// The lens is covered for a while; places are not recognised, so that what comes then is another part.
TEST(MapSurface, HasSnapshotsOfEveryMapPart) {
  Source source("synthetic:desk?sensor=rgbd&width=160&height=120&rounds=1&frames=160");
  Slam slam(source.rig(), {.mode = RunMode::kDeterministic, .places = false});
  MapSurface surface(slam.map(), {.model = {.voxel_size = 0.03}});
  const std::vector<std::uint8_t> black(2 * 160 * 120);
  std::optional<PoseEstimate> first, pose;
  int number = 0;
  for (FrameView frame; source.next(frame); ++number) {
    if (number >= 40 && number < 100) {
      frame.left.data = frame.depth.data = black.data();
      frame.left.stride = 160;
      frame.depth.stride = 320;
      frame.owner = nullptr;
    }
    slam.push(frame);
    pose = slam.latest();
    if (number == 30) first = pose;
    if (pose && pose->keyframe) surface.add(frame, pose->frame);
  }
  surface.update(slam.map());
  ASSERT_EQ(pose->state, TrackingState::kTracked);
  ASSERT_NE(pose->map_part, first->map_part);
  EXPECT_EQ(surface.snapshot().map_part(), pose->map_part);
  EXPECT_EQ(surface.snapshot(pose->map_part).mesh().positions, surface.snapshot().mesh().positions);
  const SurfaceSnapshot before = surface.snapshot(first->map_part);
  EXPECT_EQ(before.map_part(), first->map_part);
  EXPECT_EQ(before.map_version(), surface.snapshot().map_version());
  EXPECT_GT(before.mesh().triangles.size(), 500U);
  EXPECT_NE(before.mesh().positions, surface.snapshot().mesh().positions);
  EXPECT_EQ(surface.snapshot(12345).map_part(), kNoId);
  EXPECT_TRUE(before.camera_pose(*first, slam.map()));
  EXPECT_FALSE(before.camera_pose(*pose, slam.map())) << "in another part";
}

/// Triangles of all cells, by the cells' positions.
using Cells = std::map<std::array<std::int32_t, 3>, std::size_t>;

void take(const SurfaceChanges& changes, Cells& cells) {
  for (const SurfacePiece& piece : changes.pieces) {
    cells.erase(piece.cell);
    if (!piece.mesh.triangles.empty()) cells[piece.cell] = piece.mesh.triangles.size();
  }
}

TEST_F(MapSurfaceTest, SaysWhatChangedInItsMesh) {
  EXPECT_TRUE(surface_.mesh_changes(0).pieces.empty()) << "there is no map yet";
  Cells followed;
  std::uint64_t revision = 0;
  std::size_t told = 0;
  for (int n = 0; n < 4; ++n) {
    add_keyframes(2);
    const SurfaceChanges changes = surface_.mesh_changes(revision);
    EXPECT_DOUBLE_EQ(changes.cell_size, 8 * kVoxel);
    EXPECT_GT(changes.revision, revision);
    revision = changes.revision;
    told = changes.pieces.size();
    take(changes, followed);
  }
  const SurfaceChanges again = surface_.mesh_changes(revision);
  EXPECT_EQ(again.revision, revision);
  EXPECT_TRUE(again.pieces.empty()) << "nothing has changed since";
  Cells whole;
  take(surface_.mesh_changes(0), whole);
  EXPECT_EQ(followed, whole) << "who follows has what there is";
  EXPECT_LT(told, whole.size()) << "two keyframes do not change all";
  std::size_t triangles = 0;
  for (const auto& [cell, count] : whole) triangles += count;
  const std::size_t in_snapshot = surface_.snapshot().mesh().triangles.size();
  EXPECT_GE(triangles, in_snapshot) << "small specks are left out there";
  EXPECT_LT(triangles, 1.1 * static_cast<double>(in_snapshot));
}

TEST_F(MapSurfaceTest, SaysWhatIsWrong) {
  add_keyframes(1);
  const MapSnapshot early = slam_.map();
  add_keyframes(2);
  EXPECT_THROW(surface_.update(early), std::invalid_argument);
  EXPECT_THROW(surface_.add({}, 1000), std::invalid_argument);
  FrameView frame;
  ASSERT_TRUE(source_.next(frame));
  EXPECT_THROW(surface_.add(frame, 0), std::invalid_argument) << "a number that does not grow";
  EXPECT_THROW(MapSurface(slam_.map(), {.memory_mb = 0}), std::invalid_argument);
  EXPECT_THROW(MapSurface(slam_.map(), {.model = {.voxel_size = 0}}), std::invalid_argument);
  EXPECT_NE(MapSurfaceOptions{.model = {.voxel_size = 0}}.invalid_reason().find("model.voxel_size"),
            std::string::npos);
  DistanceBox box;
  EXPECT_THROW((void)surface_.snapshot().distances(box), std::invalid_argument);
}

TEST_F(MapSurfaceTest, BeforeTheFirstKeyframeNothingIsKnown) {
  surface_.update(slam_.map());
  for (const SurfaceSnapshot& nothing : {surface_.snapshot(), SurfaceSnapshot()}) {
    EXPECT_EQ(nothing.map_part(), kNoId);
    EXPECT_EQ(nothing.at({0, 0, 1}).state, SpaceState::kUnknown);
    EXPECT_TRUE(nothing.mesh().triangles.empty());
    const DistanceField field = nothing.distances({{0, 0, 0}, {1, 1, 1}, 0.5});
    EXPECT_EQ(field.states.size(), 8U);
    EXPECT_EQ(field.states[0], SpaceState::kUnknown);
  }
}

/// Of a stereo run whose right images lie `rows` lower.
SurfaceSnapshot surface_of_pair(int rows) {
  Source source("synthetic:desk?width=320&height=240&frames=40");
  Slam slam(source.rig(), {.mode = RunMode::kDeterministic});
  MapSurface surface(slam.map(), {.model = {.voxel_size = 0.02}});
  for (FrameView frame; source.next(frame);) {
    const auto* right = static_cast<const std::uint8_t*>(frame.right.data);
    const std::ptrdiff_t lower = rows * frame.right.stride;
    std::vector<std::uint8_t> slipped(static_cast<std::size_t>(frame.right.stride * frame.right.height));
    std::copy(right, right + static_cast<std::ptrdiff_t>(slipped.size()) - lower, slipped.begin() + lower);
    frame.right.data = slipped.data();
    const auto owner = std::exchange(frame.owner, nullptr);  // of the left image still; both are copied
    slam.push(frame);
    const auto pose = slam.latest();
    if (pose && pose->keyframe) surface.add(frame, pose->frame);
  }
  surface.update(slam.map());
  return surface.snapshot();
}

TEST(MapSurface, RowsThatSlippedAreTakenBack) {
  const SurfaceSnapshot aligned = surface_of_pair(0), slipped = surface_of_pair(2);
  const SurfaceMesh mesh = slipped.mesh();
  std::size_t near = 0;
  for (const auto& x : mesh.positions) {
    const SpacePoint there = aligned.at({x[0], x[1], x[2]});
    near += there.state != SpaceState::kUnknown && std::abs(there.distance) < 0.03;
  }
  EXPECT_GT(static_cast<double>(near), 0.85 * static_cast<double>(mesh.positions.size()));
  EXPECT_GT(static_cast<double>(mesh.positions.size()),
            0.8 * static_cast<double>(aligned.mesh().positions.size()));
}

TEST_F(MapSurfaceTest, MeshesAreSavedByTheKindOfTheirName) {
  add_keyframes(2);
  const SurfaceMesh mesh = surface_.snapshot().mesh();
  const ScratchFolder folder;
  for (const char* name : {"a.ply", "a.obj", "a.glb"}) {
    save_mesh(mesh, folder / name);
    EXPECT_GT(std::filesystem::file_size(folder / name), 12 * mesh.positions.size()) << name;
  }
  EXPECT_THROW(save_mesh(mesh, folder / "a.stl"), std::invalid_argument);
  EXPECT_THROW(save_mesh({}, folder / "b.glb"), std::invalid_argument);
  EXPECT_THROW(save_mesh(mesh, folder / "a.glb", {0, 0, 2}), std::invalid_argument);
  EXPECT_THROW(save_mesh(mesh, folder / "none/a.ply"), std::runtime_error);
}

}  // namespace
}  // namespace twofold
