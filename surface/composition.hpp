#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <limits>
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
///
/// An update may leave blocks to the next one, since a loop changes all there are. First come those with
/// something new and those of volumes that moved far, then what moved by little or was fused anew. Until its
/// turn comes the mesh has a block as it was, moved with its volumes: to where they are on the mean, where
/// several share a surface. A wall that is there twice remains so until then.
class Composition {
 public:
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();

  /// @param rest  [voxels] an update leaves a volume where it was that has moved by no more than this,
  /// because
  ///              poses never rest while the map grows; rejoin and settle move it nevertheless
  explicit Composition(const SurfaceOptions& options, double rest = kRest) : whole_(options), rest_(rest) {}

  /// The volumes there are now, ascending by id.
  ///
  /// @param most  blocks that are made anew at most; kAll: the mesh need not move
  /// @return  blocks made anew
  std::size_t update(std::span<const PlacedVolume> volumes, std::size_t most = kAll);
  /// As update with all, but volumes stand exactly where they are said to.
  std::size_t settle(std::span<const PlacedVolume> volumes);
  /// The mesh moves with those volumes that have moved by more than half a voxel, and their blocks wait for
  /// the next updates.
  /// @return  whether there are any
  bool rejoin(std::span<const PlacedVolume> volumes);

  /// How many blocks have ever begun to wait, and how many of these are made anew, first in, first out.
  struct Progress {
    std::uint64_t marked = 0, made = 0;
  };
  /// Of those with something new.
  [[nodiscard]] Progress of_new() const { return progress(kNew); }
  /// Of those of volumes that moved by more than may rest.
  [[nodiscard]] Progress of_moved() const { return progress(kSoon); }
  /// Whether any block waits.
  [[nodiscard]] bool unfinished() const;

  [[nodiscard]] const SurfaceVolume& whole() const { return whole_; }
  [[nodiscard]] const MeshPieces& mesh() const { return mesh_; }
  [[nodiscard]] std::size_t bytes() const;

 private:
  static constexpr double kRest = 0.5;  // [voxels]
  static constexpr std::uint32_t kNoVolume = std::numeric_limits<std::uint32_t>::max();
  /// Why a block is to be made anew: one of its volumes moved by no more than may rest, was fused anew or is
  /// gone; one moved farther, or all blocks begin anew; one has something new there.
  enum Mark : std::uint8_t { kNone, kLater, kSoon, kNew };
  struct Member {
    SE3 T_w_v;                                            ///< where it was added
    std::uint64_t revision = 0;                           ///< of the volume, as far as it was added
    Vector3 low = Vector3::Constant(1e300), high = -low;  ///< bounds of its blocks, in its frame [m]
    std::vector<std::uint32_t> blocks;                    ///< of the whole, into which it reaches; each once
    bool joined = false;                                  ///< these are known
    Mark mark_as = kNew;                                  ///< those that hold nothing new, if they are not

    [[nodiscard]] bool holds_nothing() const { return (low.array() > high.array()).any(); }
  };
  /// Of a block of the whole.
  struct Reached {
    std::vector<std::uint32_t> volumes;       ///< that reach into it: ids, ascending
    std::uint32_t first_changed = kNoVolume;  ///< since it was made
    /// What volumes with smaller ids than this one say of it is in begun_; 0: nothing is. So a block that a
    /// camera keeps looking at costs no more with each further volume that sees it.
    std::uint32_t begun_before = 0;
    bool is_elsewhere = false;  ///< what it holds has moved by more than may rest, or some of it
  };
  struct Left {
    std::uint32_t block = 0, volume = 0;
    Mark mark_as = kLater;
  };
  /// How the mesh of a volume moves.
  struct Step {
    const SurfaceVolume* volume = nullptr;
    SE3 T_v_w;  ///< where the mesh has it so far
    Motion motion = Motion::Identity();
  };
  using Steps = std::map<std::uint32_t, Step>;            // of each volume
  using Resamplers = std::map<std::uint32_t, Resampler>;  // likewise

  bool rejoin(std::span<const PlacedVolume> volumes, double rest, bool mesh_moves);
  [[nodiscard]] bool has_moved(const Member& member, const SE3& T_w_v, double rest) const;
  [[nodiscard]] Motion mean_motion(const Steps& steps, const Vector3& x_w) const;
  [[nodiscard]] static bool has_surface(const SurfaceVolume& volume, const Vector3& x_v);
  void let_go_of_empty_blocks();
  void remove_all_but(std::span<const PlacedVolume> volumes);
  void take_changes(const PlacedVolume& volume);
  void join(std::uint32_t id, Member& member, const BlockPosition& block, Mark mark_as);
  void leave(std::uint32_t id, Member& member, Mark mark_as);
  void extend_bounds(Member& member, const SurfaceVolume& volume) const;
  void mark_left();
  void mark(std::uint32_t block, std::uint32_t changed, Mark as);
  [[nodiscard]] Progress progress(Mark of) const { return {made_[of] + queues_[of].size(), made_[of]}; }
  std::size_t compose(std::span<const PlacedVolume> volumes, std::size_t most);
  [[nodiscard]] std::vector<Pending> pending() const;
  void make(std::uint32_t block, Mark marked_as, Resamplers& resamplers);
  void begin(std::uint32_t block, std::span<Resampler* const> first);

  SurfaceVolume whole_;
  double rest_;
  MeshPieces mesh_;
  std::map<std::uint32_t, Member> members_;
  std::vector<Reached> reached_;  ///< of each block of the whole
  std::vector<Mark> marks_;       ///< likewise
  std::vector<Left> left_;        ///< blocks that volumes have left, not marked yet
  /// Blocks by why they were marked; of some the turn has come in another queue since.
  std::array<std::deque<std::uint32_t>, kNew + 1> queues_;
  std::array<std::uint64_t, kNew + 1> made_{};  ///< blocks taken from these
  BlockTable begun_;                            ///< Reached::begun_before
  std::size_t empty_blocks_ = 0;                ///< into which no volume reaches any more
};

}  // namespace twofold
