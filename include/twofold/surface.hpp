#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "twofold/map.hpp"
#include "twofold/types.hpp"

namespace twofold {

struct SurfaceModelOptions {
  double voxel_size = 0.05;  ///< distance of two samples [m], 1e-4 .. 10
  double max_depth =
      0;  ///< readings farther than this begin no surface [m] >= 0; 0: CameraRig's bounds alone
  /// Free space away from surfaces is kept as far as this from the camera [m] >= 0; 0: as far as there are
  /// readings.
  double max_free_depth = 0;
  /// Stereo: depth is looked for from here on [m] >= 0; 0: from CameraRig::depth_min, or 0.4 if that is
  /// nearer. The nearer, the longer `add` takes. Nothing nearer than any of three is seen: this,
  /// CameraRig::depth_min, and the depth whose disparity is 0.4 of the image's width, 2.5 fx baseline /
  /// width. What is nearer than depth is looked for leaves holes, and in some per cent of its pixels wrong
  /// depth, by chance: a robot has to look for it otherwise.
  double min_stereo_depth = 0;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] TWOFOLD_API std::string invalid_reason() const;
};

enum class SpaceState : std::uint8_t {
  kUnknown,  ///< never seen, too far inside a surface, or hidden by what stands where free space was
  kFree,     ///< outside every surface, near one or seen through
  kOccupied  ///< inside a surface, as far as the truncation
};

/// What is known of one position.
struct SpacePoint {
  SpaceState state = SpaceState::kUnknown;
  /// From the surface [m], positive outside; truncated at four voxels or at three standard deviations of the
  /// depth, whichever is more, but never at more than 60 voxels. Free space away from surfaces: four voxels,
  /// or less within a voxel of where distances are known. kUnknown: 0 (SurfaceModel::at; DistanceField::at
  /// has its own). Measured along the cameras' rays and shortened by the slant: beside rims and in clutter a
  /// surface may be nearer (SurfaceModel::distances has the nearest).
  double distance = 0;
  /// d distance / d position: away from the surface, up to what was said; its length is about 1. 0 in free
  /// space away from surfaces, and where unknown.
  std::array<double, 3> gradient{0, 0, 0};
};

/// A box of space, and how finely it is asked about.
struct DistanceBox {
  std::array<double, 3> min_corner{0, 0, 0};  ///< [m]
  std::array<double, 3> max_corner{0, 0, 0};  ///< [m], above min_corner in each axis
  double resolution = 0.1;                    ///< edge of a cell [m] > 0
  double max_distance = 1;                    ///< no distance is longer [m] > 0
  /// Unknown space is an obstacle, as behind a wall it mostly is: distances are to the nearest surface or to
  /// where known free space ends. False: only surfaces count, and unknown space looks free.
  bool unknown_is_obstacle = true;

  /// Empty when valid; otherwise names the field, the rule and the value. The box and what is within
  /// max_distance of it have 2^26 cells at most, which take 0.6 GB while distances are found,
  /// and 24 bytes for each face between a free and an unknown cell.
  [[nodiscard]] TWOFOLD_API std::string invalid_reason() const;
};

/// A Euclidean signed distance field (ESDF), as planners and trajectory optimisers take it: how far the
/// nearest surface is, whichever way it lies, in the middle of each cell of a box.
struct DistanceField {
  std::array<double, 3> min_corner{0, 0, 0};  ///< of cell (0, 0, 0) [m]
  double resolution = 0;                      ///< edge of a cell [m]
  std::array<std::int32_t, 3> size{};         ///< cells along x, y, z
  /// [m], to the nearest surface; with DistanceBox::unknown_is_obstacle to that or the nearest face between a
  /// free cell and an unknown one. Its absolute value is max_distance where none lies within that. The sign
  /// is of the cell's state:
  ///
  ///               unknown_is_obstacle                     without
  ///   kFree       positive                                positive
  ///   kOccupied   negative                                negative
  ///   kUnknown    negative: the way to free space         positive, also behind a wall, where it grows with
  ///                                                       the depth: ask `states`
  ///
  /// So with it the sign changes once from free space into a wall, and the gradient leads out of it from as
  /// deep as max_distance. A robot's own place, nearer than depth begins, is unknown unless it was looked at
  /// before: take what the robot stands in for free yourself. Cell (i, j, k) is at i + size[0] * (j + size[1]
  /// * k), as in `states`.
  std::vector<float> distances;
  std::vector<SpaceState> states;

  /// Distance and gradient, linear in x, y and z between the middles of cells, in unknown cells, too; the
  /// state of the cell. Outside of the box, and what is not finite, is unknown, with a distance of 0.
  [[nodiscard]] TWOFOLD_API SpacePoint at(const std::array<double, 3>& p_world) const;
};

/// Triangles go round anticlockwise seen from outside.
struct SurfaceMesh {
  std::vector<std::array<float, 3>> positions;       ///< in the world [m]: of a run, y points down
  std::vector<std::array<float, 3>> normals;         ///< unit, pointing outside
  std::vector<std::array<std::uint8_t, 3>> colours;  ///< red, green, blue
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Writes a mesh to a file of the kind that its name ends in: .ply, .obj or .glb.
///
/// @param up  of .glb alone, unit: becomes y, which is up there; of a run, y points down
/// Throws std::invalid_argument for other names and for a .glb without triangles, std::runtime_error when the
/// file cannot be written.
TWOFOLD_API void save_mesh(const SurfaceMesh& mesh, const std::filesystem::path& file,
                           const std::array<double, 3>& up = {0, -1, 0});

/// The part of a mesh that lies in one cell of a grid.
struct SurfacePiece {
  std::array<std::int32_t, 3> cell{};  ///< its lowest corner, in cells
  SurfaceMesh mesh;                    ///< vertices on the border are in several pieces; empty: nothing there
};

/// What changed in a mesh since a revision.
struct SurfaceChanges {
  std::uint64_t revision = 0;        ///< that it leads to
  double cell_size = 0;              ///< edge of a cell [m]
  std::vector<SurfacePiece> pieces;  ///< these replace what was there; an empty one: nothing is there now
};

/// A dense surface from frames with poses, for planners and models: where is free space, how far is the next
/// obstacle, and what does it look like. A truncated signed distance field (TSDF volume) in sparse blocks.
///
///   SurfaceModel model(rig, {.voxel_size = 0.05});
///   if (estimate.keyframe && estimate.map_part == part) model.add(frame, estimate.T_world_camera);
///   if (model.at({x, y, z}).state == SpaceState::kFree) ...
///
/// Near surfaces distances are known; farther from them, free space is known in cells of four voxels an
/// edge, of which one frame must have seen through all: with no hole in the depth over it, and no surface
/// within the truncation behind it. A thing thinner than a cell therefore keeps the cell unknown around it.
///
/// What moves away is carved away by later frames. When an obstacle appears in free space, the cells behind
/// it become unknown. A model stays where its poses put it: after a loop closure, clear it and add the frames
/// of keyframes anew, which the caller keeps (PoseEstimate::keyframe). One model holds one map part: poses of
/// another have another world. Same calls, same answers. Threads: at, distances and mesh by several at once,
/// add, clear and mesh_changes by one while nobody else does anything. A model that was moved from may only
/// be assigned to or destroyed.
class TWOFOLD_API SurfaceModel {
 public:
  /// Throws std::invalid_argument naming the field of rig or options, the rule and the value; one camera has
  /// no depth.
  explicit SurfaceModel(const CameraRig& rig, const SurfaceModelOptions& options = {});
  ~SurfaceModel();
  SurfaceModel(SurfaceModel&&) noexcept;
  SurfaceModel& operator=(SurfaceModel&&) noexcept;

  /// Adds the depth of a rectified frame: its depth image, or, for stereo, by semi-global matching (rows of a
  /// slipped right image are not taken back, as Slam and MapSurface do). The left image, which RGB-D needs,
  /// too, gives the brightness, or the colours if it has them. Not for the thread that tracks: some 100 ms
  /// for a pair of 640 x 480, about 10 to 100 for a depth image, the more the smaller the voxel. Noise of
  /// depth images is taken for that of a structured-light camera.
  /// @return  pixels with depth within range; a frame with none changes nothing
  ///
  /// Throws std::invalid_argument saying what is wrong with the images or the pose, std::bad_alloc when
  /// memory ends.
  int add(const FrameView& frame, const Pose& T_world_camera);
  void clear();

  /// p_world [m]. What is not finite is unknown.
  [[nodiscard]] SpacePoint at(const std::array<double, 3>& p_world) const;
  /// The ESDF of a box: to the nearest surface of `mesh` whichever way it lies, right to a fraction of a
  /// cell: at most half of its edge at the surface itself, where `at` is finer, less farther away. Takes
  /// about a second for a million cells, and as long as `mesh`. Throws std::invalid_argument with
  /// DistanceBox::invalid_reason, std::bad_alloc when memory ends.
  [[nodiscard]] DistanceField distances(const DistanceBox& box) const;
  [[nodiscard]] SurfaceMesh mesh() const;
  /// What changed in the mesh after that revision; of 0 on, all of it. Only cells that frames changed are
  /// made anew, so that asking after each frame is cheap. Small specks, which `mesh` leaves out, are there.
  [[nodiscard]] SurfaceChanges mesh_changes(std::uint64_t since);
  /// Of all that is kept. Mostly blocks of 8^3 samples, 2.1 KB each, or 4.2 KB with the colours beside a
  /// surface, wherever a surface ever was: half the voxel is about four times as many. There is no limit;
  /// clear gives them back.
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct MapSurfaceOptions {
  SurfaceModelOptions model = {};  ///< of samples and depth images, as those of SurfaceModel
  /// Of samples and depth images [MiB] > 0: with more than this no keyframe is added, and
  /// SurfaceUpdate::beyond_memory counts it.
  double memory_mb = 2000;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] TWOFOLD_API std::string invalid_reason() const;
};

/// The surface of a run as it was in one version of its map: it does not change any more. Copies are of the
/// same one, and it keeps that version of the map (MapSnapshot). Any thread, several at once.
///
/// Before the first question is answered, what the surface has in submaps is joined, the whole of it, for
/// each snapshot anew, on the thread that asks, while others who ask wait: it takes about 0.2 s for 100
/// MB of submaps, and memory that MapSurfaceOptions::memory_mb does not count. A planner that must not wait
/// gets snapshots from a thread that calls `prepare`. After that questions take as long as SurfaceModel's.
class TWOFOLD_API SurfaceSnapshot {
 public:
  SurfaceSnapshot();  ///< of nothing
  ~SurfaceSnapshot();
  SurfaceSnapshot(const SurfaceSnapshot&);
  SurfaceSnapshot& operator=(const SurfaceSnapshot&);

  /// MapSnapshot::version of the map that it fits; 0: of nothing.
  [[nodiscard]] std::uint64_t map_version() const;
  /// Whose world positions are in; kNoId: none.
  [[nodiscard]] std::uint32_t map_part() const;
  /// T_world_camera of a tracked frame in the world that this surface is in, which a correction of the map
  /// may have moved against the pose's: by its reference keyframe and T_reference_camera. Ask for what is
  /// ahead of the camera with this pose, not with PoseEstimate::T_world_camera.
  /// @param map  of the same run, newer than the snapshot and than the frame (Slam::map): through it a
  ///             reference keyframe is found that the snapshot does not have yet, by the keyframe that shares
  ///             most points with it, else by the snapshot's newest
  /// @return  nothing where the frame is lost, in another map part, or its keyframe is in neither map, or was
  ///          culled so long ago that what replaced it is forgotten. O(keyframes beside it).
  [[nodiscard]] std::optional<Pose> camera_pose(const PoseEstimate& pose, const MapSnapshot& map = {}) const;
  /// Joins the submaps now, unless that was done, here or on a copy. Throws std::bad_alloc when memory ends.
  void prepare() const;
  /// As SurfaceModel::at.
  [[nodiscard]] SpacePoint at(const std::array<double, 3>& p_world) const;
  /// As SurfaceModel::distances.
  [[nodiscard]] DistanceField distances(const DistanceBox& box) const;
  /// As SurfaceModel::mesh.
  [[nodiscard]] SurfaceMesh mesh() const;
  /// What it keeps: its submaps, which the surface and other snapshots may have, too, and once it was asked
  /// what they are joined into. Does not wait for who joins them.
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  friend class MapSurface;
  struct Impl;
  explicit SurfaceSnapshot(std::shared_ptr<const Impl> impl);
  std::shared_ptr<const Impl> impl_;
};

/// What MapSurface::update did, and what was left out since the update before.
struct SurfaceUpdate {
  int fused = 0;        ///< keyframes whose depth was added
  int fused_anew = 0;   ///< depth images that were fused once more, since poses in their submaps had changed
  int no_readings = 0;  ///< keyframes without depth in range
  int beyond_memory = 0;  ///< keyframes left out: MapSurfaceOptions::memory_mb is reached
  int discarded = 0;      ///< frames that are no keyframes of the map: rejected, or culled before an update
  int overtaken = 0;      ///< oldest frames of more than 64 that waited: call update more often
  int waiting = 0;        ///< frames whose keyframes the map does not have yet

  friend bool operator==(const SurfaceUpdate&, const SurfaceUpdate&) = default;
};

/// The surface of a run's keyframes, which moves with the map: as `twofold run --surface` makes it, whose
/// min_stereo_depth is 0.4. Rows of a slipped stereo pair are taken back, as far as the tracker knows of them
/// when a frame is added.
///
///   MapSurface surface(slam.map(), {.model = {.voxel_size = 0.02}});
///   ... for keyframes, in a thread of yours:
///   surface.add(frame, estimate.frame);
///   surface.update(slam.map());
///   ... in a planner's thread:
///   const SurfaceSnapshot now = surface.snapshot();
///
/// Keyframes are fused into submaps that hang on the map: a loop moves them, and those inside which poses
/// have moved by more than half a voxel are fused anew. Depth images are kept for that, compressed, as long
/// as their keyframes are in the map.
///
/// Threads: add, update and mesh_changes by one at a time; snapshot and memory_bytes by any, always, also
/// meanwhile: they wait for nobody. Holding a snapshot blocks nobody: `update` copies a shared submap before
/// changing it, which costs memory.
class TWOFOLD_API MapSurface {
 public:
  /// @param map  of the run, before its first keyframe: it tells the rig, and which keyframes are a loaded
  ///             map's, of which there are no images and no surface. Later: earlier keyframes are missing
  /// Throws std::invalid_argument as SurfaceModel does.
  explicit MapSurface(const MapSnapshot& map, const MapSurfaceOptions& options = {});
  ~MapSurface();
  MapSurface(MapSurface&&) noexcept;
  MapSurface& operator=(MapSurface&&) noexcept;

  /// The depth of a rectified frame that the tracker proposed as a keyframe (PoseEstimate::keyframe), before
  /// or after the map has it. If the mapper rejects the proposal, the frame is discarded once `update` sees a
  /// later keyframe. At most 64 wait; then the oldest is discarded. A stereo pair takes about 100 ms, because
  /// its depth is computed here; a depth image is only compressed.
  /// (`twofold run --surface` keeps 48 whole images before that, which nobody has looked at yet.) Pixels are
  /// not used any more once it returns.
  /// @param number  PoseEstimate::frame
  /// Throws std::invalid_argument saying what is wrong with the images, or when `number` is not greater than
  /// that of the call before.
  void add(const FrameView& frame, std::int64_t number);
  /// Takes the newest map: submaps move, all that waits is fused, and what came of it is the snapshot from
  /// then on. Takes about as long as SurfaceModel::add of a depth image for each keyframe, and after a loop
  /// for each depth image of the submaps that it bent: `fused` and `fused_anew` times. Throws
  /// std::invalid_argument for an older map than that of the last call, std::bad_alloc when memory ends.
  SurfaceUpdate update(const MapSnapshot& map);
  /// What changed in the mesh of the camera's map part after that revision, as of the last update; of 0 on,
  /// all of it, as also after the camera came to another part: its cells replace those of the part before. In
  /// the world of snapshot().map_part(). The submaps are joined for it, only where one changed, or moved by
  /// more than half a voxel: a loop changes most pieces, and less than that moves none. Small specks, which
  /// SurfaceSnapshot::mesh leaves out, are there. The first call joins all, and from then on what is joined
  /// takes memory that memory_mb does not count. Throws std::bad_alloc when memory ends.
  [[nodiscard]] SurfaceChanges mesh_changes(std::uint64_t since);
  /// As of the end of the last update, of the map part in which the camera was then; of nothing before the
  /// first. O(1).
  [[nodiscard]] SurfaceSnapshot snapshot() const;
  /// The same of another map part: after a loss the camera mostly begins a new one, until the two are joined.
  /// Of nothing where the map has no such part.
  /// @param part  PoseEstimate::map_part
  [[nodiscard]] SurfaceSnapshot snapshot(std::uint32_t part) const;
  /// Of samples and depth images, and of what mesh_changes joined, at the end of the last call of add, update
  /// or mesh_changes. While an update lasts, and as long as older snapshots are held, what it changes is
  /// there twice.
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace twofold
