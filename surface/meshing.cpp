#include "surface/meshing.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "surface/cube_triangles.hpp"

namespace twofold {
namespace {

constexpr int kPadded = kBlockEdge + 3;  // one sample before the block, for gradients, and two behind
constexpr int kPaddedSamples = kPadded * kPadded * kPadded;

constexpr int padded_index(int x, int y, int z) {  // x, y, z from -1 on
  return ((z + 1) * kPadded + y + 1) * kPadded + x + 1;
}
constexpr std::array<int, 3> kPaddedStep{1, kPadded, kPadded* kPadded};

/// A block with the samples around it.
struct PaddedBlock {
  std::array<float, kPaddedSamples> distance;
  std::array<float, kPaddedSamples> weight;

  void fill(const BlockTable& blocks, const SampleUnits& units, const BlockPosition& at);
};

void PaddedBlock::fill(const BlockTable& blocks, const SampleUnits& units, const BlockPosition& at) {
  std::array<const VoxelBlock*, 27> around;
  for (int n = 0; n < 27; ++n)
    around[static_cast<std::size_t>(n)] =
        blocks.find({at.x + n % 3 - 1, at.y + n / 3 % 3 - 1, at.z + n / 9 - 1});
  std::size_t to = 0;
  for (int z = -1; z < kBlockEdge + 2; ++z)
    for (int y = -1; y < kBlockEdge + 2; ++y)
      for (int x = -1; x < kBlockEdge + 2; ++x, ++to) {
        const int n = ((z + 8) / 8 * 3 + (y + 8) / 8) * 3 + (x + 8) / 8;
        const VoxelBlock* block = around[static_cast<std::size_t>(n)];
        const auto s = static_cast<std::size_t>(((z & 7) * 8 + (y & 7)) * 8 + (x & 7));
        distance[to] = block != nullptr ? units.distance * block->distance[s] : 0;
        weight[to] = block != nullptr ? units.weight * block->weight[s] : 0;
      }
}

/// Which edges of a block's samples carry a vertex, and which numbers these have: edge e = 3 sample + axis.
class BlockVertices {
 public:
  void begin(std::uint32_t first) {
    first_ = first;
    bits_.fill(0);
  }
  void add(int edge) { bits_[static_cast<std::size_t>(edge / 64)] |= std::uint64_t{1} << (edge % 64); }
  void finish() {
    std::uint16_t before = 0;
    for (std::size_t w = 0; w < bits_.size(); ++w) {
      before_[w] = before;
      before = static_cast<std::uint16_t>(before + std::popcount(bits_[w]));
    }
  }
  [[nodiscard]] std::uint32_t vertex(int edge) const {
    const auto w = static_cast<std::size_t>(edge / 64);
    const std::uint64_t below = bits_[w] & ((std::uint64_t{1} << (edge % 64)) - 1);
    return first_ + before_[w] + static_cast<std::uint32_t>(std::popcount(below));
  }

 private:
  static constexpr std::size_t kWords = 3 * kBlockSamples / 64;
  std::uint32_t first_ = 0;
  std::array<std::uint64_t, kWords> bits_{};
  std::array<std::uint16_t, kWords> before_{};
};

/// Central difference, or one-sided where a neighbour was never seen.
Eigen::Vector3f gradient_at(const PaddedBlock& field, int i) {
  Eigen::Vector3f g;
  for (int a = 0; a < 3; ++a) {
    const auto at = static_cast<std::size_t>(i);
    const auto next = static_cast<std::size_t>(i + kPaddedStep[static_cast<std::size_t>(a)]);
    const auto previous = static_cast<std::size_t>(i - kPaddedStep[static_cast<std::size_t>(a)]);
    const bool has_next = field.weight[next] > 0;
    const bool has_previous = field.weight[previous] > 0;
    const float high = has_next ? field.distance[next] : field.distance[at];
    const float low = has_previous ? field.distance[previous] : field.distance[at];
    g[a] = has_next && has_previous ? 0.5f * (high - low) : high - low;
  }
  return g;
}

class MeshExtraction {
 public:
  explicit MeshExtraction(const SurfaceVolume& volume)
      : volume_(volume),
        voxel_(static_cast<float>(volume.options().voxel)),
        least_weight_(static_cast<float>(volume.options().least_weight)),
        blocks_(volume.blocks().sorted()),
        vertices_(blocks_.size()) {
    number_.reserve(blocks_.size());
    for (std::size_t b = 0; b < blocks_.size(); ++b) number_.emplace(blocks_[b], b);
  }

  TriangleMesh run() {
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      field_.fill(volume_.blocks(), volume_.units(), blocks_[b]->at);
      add_vertices(b);
    }
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      field_.fill(volume_.blocks(), volume_.units(), blocks_[b]->at);
      add_triangles(b);
    }
    drop_small_pieces(mesh_, volume_.options().least_triangles);
    return std::move(mesh_);
  }

 private:
  [[nodiscard]] bool known(int i) const {
    return field_.weight[static_cast<std::size_t>(i)] >= least_weight_;
  }
  [[nodiscard]] bool inside(int i) const { return field_.distance[static_cast<std::size_t>(i)] < 0; }

  void add_vertices(std::size_t b) {
    BlockVertices& vertices = vertices_[b];
    vertices.begin(static_cast<std::uint32_t>(mesh_.positions.size()));
    for (int s = 0; s < kBlockSamples; ++s) {
      const Eigen::Vector3i at(s % 8, s / 8 % 8, s / 64);
      const int i = padded_index(at.x(), at.y(), at.z());
      if (!known(i)) continue;
      for (int axis = 0; axis < 3; ++axis) {
        const int j = i + kPaddedStep[static_cast<std::size_t>(axis)];
        if (!known(j) || inside(i) == inside(j)) continue;
        vertices.add(3 * s + axis);
        add_vertex(*blocks_[b], s, at, axis, i, j);
      }
    }
    vertices.finish();
  }

  void add_vertex(const VoxelBlock& block, int s, const Eigen::Vector3i& at, int axis, int i, int j) {
    const float di = field_.distance[static_cast<std::size_t>(i)];
    const float dj = field_.distance[static_cast<std::size_t>(j)];
    const float t = di / (di - dj);
    Eigen::Vector3f grid(static_cast<float>(kBlockEdge * block.at.x + at.x()),
                         static_cast<float>(kBlockEdge * block.at.y + at.y()),
                         static_cast<float>(kBlockEdge * block.at.z + at.z()));
    grid[axis] += t;
    mesh_.positions.emplace_back(grid * voxel_);
    const Eigen::Vector3f normal = (1 - t) * gradient_at(field_, i) + t * gradient_at(field_, j);
    mesh_.normals.emplace_back(normal.norm() > 0 ? Eigen::Vector3f(normal.normalized())
                                                 : Eigen::Vector3f::UnitZ());
    const float weight =
        std::min(field_.weight[static_cast<std::size_t>(i)], field_.weight[static_cast<std::size_t>(j)]);
    mesh_.sigmas.push_back(voxel_ / std::sqrt(weight));
    add_colour(block, s, at, axis, t);
  }

  /// Of the nearer of the two samples that has one.
  void add_colour(const VoxelBlock& block, int s, Eigen::Vector3i at, int axis, float t) {
    std::array<std::uint16_t, 3> near = colour_of(block, static_cast<std::size_t>(s));
    ++at[axis];
    const VoxelBlock* next = &block;
    if (at[axis] == kBlockEdge) {
      BlockPosition beside = block.at;
      (axis == 0 ? beside.x : axis == 1 ? beside.y : beside.z) += 1;
      next = volume_.blocks().find(beside);
      at[axis] = 0;
    }
    const auto far = colour_of(*next, static_cast<std::size_t>((at.z() * 8 + at.y()) * 8 + at.x()));
    const std::array<std::uint16_t, 3> none{};
    if ((t > 0.5f && far != none) || near == none) near = far;
    mesh_.colours.push_back({static_cast<std::uint8_t>(near[0] / 256),
                             static_cast<std::uint8_t>(near[1] / 256),
                             static_cast<std::uint8_t>(near[2] / 256)});
  }

  void add_triangles(std::size_t b) {
    around_.fill(nullptr);
    for (int s = 0; s < kBlockSamples; ++s) {
      const int i = padded_index(s % 8, s / 8 % 8, s / 64);
      unsigned code = 0;
      bool all_known = true;
      for (int c = 0; c < kCubeCorners && all_known; ++c) {
        const int corner =
            i + (c & 1) * kPaddedStep[0] + (c >> 1 & 1) * kPaddedStep[1] + (c >> 2) * kPaddedStep[2];
        all_known = known(corner);
        code |= inside(corner) ? 1U << c : 0U;
      }
      if (!all_known || code == 0 || code == 255) continue;
      for (const auto& triangle : cube_triangles(code)) {
        mesh_.triangles.push_back(
            {vertex_on(b, s, triangle[0]), vertex_on(b, s, triangle[1]), vertex_on(b, s, triangle[2])});
      }
    }
  }

  /// Vertex on an edge of the cell whose lowest corner is sample s of block b.
  std::uint32_t vertex_on(std::size_t b, int s, int cube_edge) {
    const CubeEdge& edge = cube_edges()[static_cast<std::size_t>(cube_edge)];
    const int x = s % 8 + (edge.corner & 1);
    const int y = s / 8 % 8 + (edge.corner >> 1 & 1);
    const int z = s / 64 + (edge.corner >> 2);
    const auto n = static_cast<std::size_t>(x / 8 + 2 * (y / 8) + 4 * (z / 8));
    if (around_[n] == nullptr) {
      const BlockPosition& at = blocks_[b]->at;
      const VoxelBlock* block = volume_.blocks().find({at.x + x / 8, at.y + y / 8, at.z + z / 8});
      around_[n] = &vertices_[number_.at(block)];
    }
    return around_[n]->vertex(3 * (((z & 7) * 8 + (y & 7)) * 8 + (x & 7)) + edge.axis);
  }

  const SurfaceVolume& volume_;
  const float voxel_, least_weight_;
  std::vector<const VoxelBlock*> blocks_;
  std::vector<BlockVertices> vertices_;
  std::unordered_map<const VoxelBlock*, std::size_t> number_;
  std::array<const BlockVertices*, 8> around_{};
  PaddedBlock field_;
  TriangleMesh mesh_;
};

/// The smallest vertex of the piece that a vertex belongs to.
std::vector<std::uint32_t> pieces_of(const TriangleMesh& mesh) {
  std::vector<std::uint32_t> parent(mesh.positions.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const auto& t : mesh.triangles) {
    for (const std::uint32_t v : {t[1], t[2]}) {
      const std::uint32_t a = root(t[0]);
      const std::uint32_t b = root(v);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  for (std::uint32_t v = 0; v < parent.size(); ++v) parent[v] = root(v);
  return parent;
}

template <class T>
void keep(std::vector<T>& values, const std::vector<std::uint32_t>& kept) {
  if (values.empty()) return;
  for (std::size_t n = 0; n < kept.size(); ++n) values[n] = values[kept[n]];
  values.resize(kept.size());
}

void drop_unused_vertices(TriangleMesh& mesh) {
  constexpr std::uint32_t kUnused = 0xffffffff;
  std::vector<std::uint32_t> renamed(mesh.positions.size(), kUnused);
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t v : t) renamed[v] = 0;
  std::vector<std::uint32_t> kept;
  for (std::uint32_t v = 0; v < renamed.size(); ++v) {
    if (renamed[v] == kUnused) continue;
    renamed[v] = static_cast<std::uint32_t>(kept.size());
    kept.push_back(v);
  }
  keep(mesh.positions, kept);
  keep(mesh.normals, kept);
  keep(mesh.colours, kept);
  keep(mesh.sigmas, kept);
  for (auto& t : mesh.triangles)
    for (std::uint32_t& v : t) v = renamed[v];
}

}  // namespace

std::size_t drop_small_pieces(TriangleMesh& mesh, int least) {
  const std::vector<std::uint32_t> piece = pieces_of(mesh);
  std::vector<int> triangles(mesh.positions.size(), 0);
  for (const auto& t : mesh.triangles) ++triangles[piece[t[0]]];
  const std::size_t before = mesh.triangles.size();
  std::erase_if(mesh.triangles, [&](const auto& t) { return triangles[piece[t[0]]] < least; });
  drop_unused_vertices(mesh);
  return before - mesh.triangles.size();
}

TriangleMesh extract_mesh(const SurfaceVolume& volume) {
  return MeshExtraction(volume).run();
}

}  // namespace twofold
