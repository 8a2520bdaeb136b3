#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <vector>

#include "geometry/triangle_mesh.hpp"
#include "surface/block_mesh.hpp"
#include "surface/volume.hpp"

namespace twofold {

/// [A b] takes a position x to A x + b [m]; rigid, or the mean of rigid ones that are alike.
using Motion = Eigen::Matrix<double, 3, 4>;

/// The mesh of a volume in a piece for each block, of which only those are made anew whose samples, or whose
/// neighbours' samples, changed. Whoever shows it asks for what changed since a revision. One thread at a
/// time; memory follows the surface. Same volumes, same bytes. Where there is no surface any more, only the
/// revision stays.
class MeshPieces {
 public:
  /// Takes over what changed in the volume since the last call, which was of the same volume.
  /// @param pending  of the volume's blocks; empty: nothing is
  /// @return  pieces extracted
  std::size_t update(const SurfaceVolume& volume, std::span<const Pending> pending = {});

  /// Moves pieces, until an update makes them anew; neighbours still share their vertices.
  /// @param motion_of  a piece's, asked for one of its vertices
  void move(const std::function<Motion(const Vector3&)>& motion_of);

  /// Counts the calls that changed or moved a piece; 0: there was none yet.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  /// Blocks whose piece changed after that revision, ascending; also those that have none any
  /// more, unless it is 0: there was nothing before.
  [[nodiscard]] std::vector<BlockPosition> changed_since(std::uint64_t revision) const;
  /// The triangles of a block's cells by themselves: vertices on the border to the blocks behind it are in
  /// their pieces as well. Specks of noise, which joined and min_triangles leave out, are among them.
  [[nodiscard]] TriangleMesh piece(const BlockPosition& at) const;

  /// All pieces as one mesh, in the order of their positions; they share the vertices on their borders.
  /// Pieces of the surface of fewer than min_triangles triangles are left out, as extract_mesh leaves them
  /// out.
  [[nodiscard]] TriangleMesh joined(int min_triangles) const;
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct Piece {
    BlockMesh mesh;
    std::uint64_t revision = 0;  ///< of the last change
  };
  /// Of the blocks that an edge of a block's cells can lie in, those that have a piece.
  using Behind = std::array<const BlockMesh*, 8>;

  [[nodiscard]] Behind behind(const BlockPosition& at) const;
  /// Whether a triangle's vertices are there still, though neighbours may have been made anew alone.
  [[nodiscard]] static bool has_all(const Behind& blocks, const std::array<VertexPlace, 3>& triangle);
  /// Which of the volume's blocks need their piece made anew: samples that it rests on have changed, or it
  /// was moved. Those that are pending are left to a later update.
  [[nodiscard]] std::vector<std::uint32_t> outdated(const SurfaceVolume& volume,
                                                    std::span<const Pending> pending);
  void touch(const BlockPosition& at);
  bool replace(const BlockPosition& at, const BlockMesh& piece);

  std::map<BlockPosition, Piece> pieces_;
  std::uint64_t revision_ = 0;
  std::uint64_t seen_ = 0;            ///< of the volume's revisions
  std::vector<BlockPosition> moved_;  ///< pieces that are not where the volume has them
};

}  // namespace twofold
