#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <unordered_map>

#include "surface/depth_view.hpp"
#include "surface/options.hpp"
#include "surface/volume.hpp"

namespace twofold {

/// Space that depth images looked through, also where no surface is near and a SurfaceVolume has no block: a
/// bit for each cell, a cube of four voxels an edge. (Of two, twice as much is free beside rims and holes,
/// but the images of a corridor took three times as long at a voxel of 1 cm; of eight, an image has often no
/// cell.)
///
/// A cell becomes free when one image looks through all of it: it lies in the view, each reading over it is
/// there, and is farther than the cell by the truncation. A cell is forgotten when an image does not see
/// into it any more because of something that stands where free space was: it may be that thing's inside.
/// What a wall hides that was there all the time stays known.
///
/// One thread at a time.
class FreeSpace {
 public:
  /// @param options  those of the volume, whose truncation it takes
  /// @param reach    cells farther from the camera do not become free [m]; 0: as far as there are readings
  FreeSpace(const SurfaceOptions& options, double reach);

  /// Adds what a depth image taken from T_c_v looks through.
  void add(const DepthView& view, const SE3& T_c_v);
  /// Forgets what a depth image does not see into any more, and makes nothing free: for what other images
  /// saw through, into whose space things have come.
  void forget_hidden(const DepthView& view, const SE3& T_c_v);
  /// Forgets those cells that forget_hidden made `before` forget, unless an image added to it saw through
  /// them later: `before` is this one before its images were added anew.
  void forget_as(const FreeSpace& before);
  /// Cells of this one that lie wholly in free cells of another one, whose frame lies at T_v_o: those of a
  /// turned one lose a rim of a cell.
  void add(const FreeSpace& other, const SE3& T_v_o);
  void clear() {
    groups_.clear();
    hidden_.clear();
  }

  /// Whether the cell was looked through, whatever the volume has there by now.
  [[nodiscard]] bool contains(const BlockPosition& cell) const;
  /// What free space adds to a volume where SurfaceVolume::distance knows nothing: no surface is nearer to
  /// x_v than this, to a voxel [m]. Nothing where one of the eight samples around x_v is in a block and
  /// unseen or inside a surface, or in no block and not free.
  [[nodiscard]] std::optional<double> clearance(const SurfaceVolume& volume, const Vector3& x_v) const;
  [[nodiscard]] std::size_t bytes() const;

 private:
  static constexpr int kCellEdge = 4;   // voxels along an edge of a cell
  static constexpr int kGroupEdge = 8;  // cells along an edge of a group
  using Group = std::bitset<kGroupEdge * kGroupEdge * kGroupEdge>;
  struct Hash {
    std::size_t operator()(const BlockPosition& at) const { return hash_of(at); }
  };
  using Groups = std::unordered_map<BlockPosition, Group, Hash>;
  class Look;  // of one depth image
  enum class Sight : std::uint8_t { kNone, kThrough, kHidden, kMixed };

  void visit_all(const Look& look);
  /// Whether all corners of a cell lie in free cells, from its middle and its axes on [cells].
  [[nodiscard]] bool holds(const Vector3& middle, const Matrix3& axes) const;
  /// A cube of edge^3 cells from `first` on. edge: a power of two, of whose multiples `first` is.
  void visit(const Look& look, const BlockPosition& first, std::int32_t edge, bool hidden);
  void forget_if_hidden(const Look& look, const BlockPosition& cell);
  void free_all(const BlockPosition& first, std::int32_t edge);
  [[nodiscard]] static BlockPosition group_of(const BlockPosition& cell);
  [[nodiscard]] static std::size_t bit_of(const BlockPosition& cell);
  [[nodiscard]] static std::size_t bytes_of(const Groups& groups);

  SurfaceOptions options_;
  double reach_;
  Groups groups_;  ///< free cells
  Groups hidden_;  ///< cells that were free until forget_hidden, and not seen through since
};

}  // namespace twofold
