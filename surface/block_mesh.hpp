#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "surface/volume.hpp"

namespace twofold {

/// A vertex of the surface, in the volume's frame.
struct SurfaceVertex {
  Eigen::Vector3f position;  ///< [m]
  Eigen::Vector3f normal;    ///< unit, pointing outside
  float sigma = 0;           ///< standard deviation of the position along the normal, an upper estimate [m]
  std::array<std::uint8_t, 3> colour{};

  friend bool operator==(const SurfaceVertex&, const SurfaceVertex&) = default;
};

/// Which edges between a block's samples carry a vertex, and which number in the block these have: edge
/// e = 3 sample + axis, from the sample on.
class CrossedEdges {
 public:
  void add(int edge) { bits_[static_cast<std::size_t>(edge / 64)] |= std::uint64_t{1} << (edge % 64); }
  /// After all were added, before a number is asked for.
  void finish() {
    std::uint16_t before = 0;
    for (std::size_t w = 0; w < kWords; ++w) {
      before_[w] = before;
      before = static_cast<std::uint16_t>(before + std::popcount(bits_[w]));
    }
  }
  [[nodiscard]] bool has(int edge) const {
    return (bits_[static_cast<std::size_t>(edge / 64)] >> (edge % 64) & 1U) != 0;
  }
  /// Of an edge that was added.
  [[nodiscard]] std::uint32_t number(int edge) const {
    const auto w = static_cast<std::size_t>(edge / 64);
    const std::uint64_t below = bits_[w] & ((std::uint64_t{1} << (edge % 64)) - 1);
    return before_[w] + static_cast<std::uint32_t>(std::popcount(below));
  }
  friend bool operator==(const CrossedEdges&, const CrossedEdges&) = default;

 private:
  static constexpr std::size_t kWords = 3 * kBlockSamples / 64;
  std::array<std::uint64_t, kWords> bits_{};
  std::array<std::uint16_t, kWords> before_{};
};

/// A vertex as the triangles of a block name it: its edge in this block or in one of those behind it.
struct VertexPlace {
  std::uint16_t block = 0;  ///< x + 2 y + 4 z: how many blocks farther along each axis
  std::uint16_t edge = 0;   ///< of CrossedEdges

  friend bool operator==(const VertexPlace&, const VertexPlace&) = default;
};

/// What is still to be done to a block's samples. Its piece stays as it is until then, but for triangles that
/// end where a neighbour has no vertex any more. kChanges: they will differ a little. kOthers: they belong
/// elsewhere; neighbours whose pieces are made before have no triangles that end in them.
enum class Pending : std::uint8_t { kNothing, kChanges, kOthers };

/// A block's piece of the mesh: the vertices between its samples and the next ones along each axis, in the
/// order of their edges, and the triangles of the cells whose lowest corner is one of its samples.
struct BlockMesh {
  CrossedEdges edges;
  std::vector<SurfaceVertex> vertices;
  std::vector<std::array<VertexPlace, 3>> triangles;

  [[nodiscard]] bool empty() const { return vertices.empty() && triangles.empty(); }
  friend bool operator==(const BlockMesh&, const BlockMesh&) = default;
};

/// Marching cubes, block by block. A piece rests on the samples of its block and of the 26 around it.
class BlockMesher {
 public:
  /// The volume and what is pending in its blocks (empty: nothing) must outlive the mesher, and not change.
  BlockMesher(const SurfaceVolume& volume, std::span<const Pending> pending);

  /// Reuses what `piece` holds.
  void extract(const BlockPosition& at, BlockMesh& piece);

 private:
  static constexpr int kPadded = kBlockEdge + 3;  // one sample before the block, for gradients; two behind
  static constexpr int kPaddedSamples = kPadded * kPadded * kPadded;
  static constexpr std::array<int, 3> kStep{1, kPadded, kPadded* kPadded};
  using Around = std::array<const VoxelBlock*, 27>;

  [[nodiscard]] static int padded_index(int x, int y, int z) {  // from -1 on
    return ((z + 1) * kPadded + y + 1) * kPadded + x + 1;
  }
  /// One bit a sample, from sample 0 of a row on, to the first of the block behind.
  struct Row {
    unsigned known = 0;   ///< well enough for the mesh to rest on
    unsigned inside = 0;  ///< of the surface
  };
  static constexpr int kRows = kBlockEdge + 1;  // along an axis: up to the first of the block behind
  [[nodiscard]] const Row& row(int y, int z) const { return rows_[static_cast<std::size_t>(z * kRows + y)]; }
  /// Whether there is anything to be made of the block, as far as a glance tells.
  [[nodiscard]] bool find_blocks(const BlockPosition& at);
  /// Number of the block there; nothing if there is none, or if its samples belong elsewhere.
  [[nodiscard]] std::optional<std::uint32_t> neighbour(const BlockPosition& at) const;
  void fill();
  void fill_row(int y, int z, std::size_t to);
  /// Whether a sample is inside that a cell of the block touches: without one there is no surface.
  [[nodiscard]] bool find_rows();
  void add_vertices(const BlockPosition& at, BlockMesh& piece) const;
  [[nodiscard]] SurfaceVertex vertex(const BlockPosition& at, int s, int axis) const;
  [[nodiscard]] std::array<std::uint8_t, 3> colour(int s, int axis, float t) const;
  [[nodiscard]] Eigen::Vector3f gradient(int i) const;
  void add_triangles(BlockMesh& piece) const;

  const SurfaceVolume& volume_;
  const std::span<const Pending> pending_;
  const float voxel_;
  std::uint16_t min_weight_ = 0;  // [steps]
  Around around_{};               // of the block: x + 3 y + 9 z, the block itself being 13
  std::array<float, kPaddedSamples> distance_{}, weight_{};
  std::array<Row, static_cast<std::size_t>(kRows) * kRows> rows_{};
};

}  // namespace twofold
