#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <vector>

#include "surface/mesh_pieces.hpp"
#include "surface/sampling.hpp"
#include "surface/volume.hpp"

namespace twofold {

/// A volume at its place among others.
struct PlacedVolume {
  std::uint32_t id = 0;  ///< never another one's
  const SurfaceVolume* volume = nullptr;
  SE3 T_w_v;  ///< of the volume's frame in the world
};

/// Several volumes in one, in the world's frame, and its mesh, kept up to date block by block: only what a
/// volume changed, or what a moved volume leaves and comes to, is made anew. What it holds is what
/// SurfaceVolume::add makes of the volumes in the order of their ids, byte for byte, once `settle` was
/// called. One thread at a time.
class Composition {
 public:
  /// @param rest  [voxels] a volume that has moved by no more than this stays where it was, in an update and
  ///              in the mesh, because poses never rest while the map grows
  explicit Composition(const SurfaceOptions& options, double rest = kRest) : whole_(options), rest_(rest) {}

  /// Asked now and then while blocks are made anew, with the share that is done.
  using GivesUp = std::function<bool(double done)>;

  /// The volumes there are now, ascending by id.
  ///
  /// @param gives_up  true: the remaining blocks, and the mesh, are left to the next call, since the
  ///                  volumes have moved again meanwhile
  /// @return  blocks made anew
  std::size_t update(std::span<const PlacedVolume> volumes, const GivesUp& gives_up = {}) {
    return update(volumes, rest_, gives_up);
  }
  /// As update, but volumes stand exactly where they are said to.
  std::size_t settle(std::span<const PlacedVolume> volumes) { return update(volumes, 0, {}); }
  /// The volume that moved farthest since it was joined is joined anew by the next update, if it moved by
  /// more than half a voxel: one at a time, where time is left.
  /// @return  whether there is one
  bool rejoin_farthest(std::span<const PlacedVolume> volumes);
  /// Moves the mesh as volumes have moved that may not rest since it was made: each piece by the mean of
  /// those that have surface there. They are joined anew by the next update, which takes far longer: a wall
  /// that is twice in the mesh remains so until then.
  /// @return  whether any moved
  bool move_mesh(std::span<const PlacedVolume> volumes);
  /// Whether the last call of update gave up.
  [[nodiscard]] bool unfinished() const { return !marked_.empty(); }

  [[nodiscard]] const SurfaceVolume& whole() const { return whole_; }
  [[nodiscard]] const MeshPieces& mesh() const { return mesh_; }
  [[nodiscard]] std::size_t bytes() const;

 private:
  static constexpr double kRest = 0.5;  // [voxels]
  struct Member {
    SE3 T_w_v;                                            ///< where it was added
    std::uint64_t revision = 0;                           ///< of the volume, as far as it was added
    Vector3 low = Vector3::Constant(1e300), high = -low;  ///< bounds of its blocks, in its frame [m]
    std::vector<std::uint32_t> blocks;                    ///< of the whole, into which it reaches; each once
  };

  std::size_t update(std::span<const PlacedVolume> volumes, double rest, const GivesUp& gives_up);
  struct Moved {
    const SurfaceVolume* volume = nullptr;
    SE3 T_v_w;      ///< where the mesh has it so far
    Motion motion;  ///< from there to where it is now
  };
  [[nodiscard]] static bool has_surface(const SurfaceVolume& volume, const Vector3& x_v);
  [[nodiscard]] static Motion mean_motion(std::span<const Moved> all, const Vector3& x_w);
  void let_go_of_empty_blocks();
  void extend_bounds(Member& member, const SurfaceVolume& volume) const;
  [[nodiscard]] bool still_stands(Member& member, const PlacedVolume& now, double rest) const;
  [[nodiscard]] static double farthest_way(const Member& member, const SE3& T_old, const SE3& T_new);
  void remove_all_but(std::span<const PlacedVolume> volumes, double rest);
  void remove(std::uint32_t id, const Member& member);
  void take_changes(const PlacedVolume& volume);
  void mark(std::uint32_t block);
  std::size_t compose(std::span<const PlacedVolume> volumes, const GivesUp& gives_up);

  SurfaceVolume whole_;
  double rest_;
  MeshPieces mesh_;
  std::map<std::uint32_t, Member> members_;
  std::map<std::uint32_t, SE3> mesh_at_;              ///< T_w_v of the volumes in the mesh
  std::vector<std::vector<std::uint32_t>> in_block_;  ///< of each block of the whole: ids, ascending
  std::vector<std::uint32_t> marked_;                 ///< blocks to be made anew
  std::vector<std::uint8_t> is_marked_;
  std::size_t empty_blocks_ = 0;  ///< into which no volume reaches any more
};

}  // namespace twofold
