#include "surface/block_mesh.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "surface/cube_triangles.hpp"
#include "surface/lanes.hpp"

namespace twofold {
namespace {

constexpr std::size_t kOwn = 13;
constexpr unsigned kOfBlock = 0xff;  // bits of a row that stand for samples of the block itself

std::size_t sample_at(int x, int y, int z) {  // modulo the block
  return static_cast<std::size_t>(((z & 7) * kBlockEdge + (y & 7)) * kBlockEdge + (x & 7));
}

/// Bit i is set where lane i of a comparison is.
template <class Comparison>
unsigned bits_of(const Comparison& lanes) {
  constexpr LaneUnsignedShort kBits{1, 2, 4, 8, 16, 32, 64, 128};
  const auto halves = reinterpret_cast<std::uint64_t __attribute__((vector_size(sizeof(LaneShort))))>(
      reinterpret_cast<const LaneUnsignedShort&>(lanes) & kBits);
  const std::uint64_t four = halves[0] | halves[1];
  const std::uint64_t two = four | four >> 32;
  return static_cast<unsigned>((two | two >> 16) & 0xff);
}

/// The smallest number of steps that is at least so much weight.
std::uint16_t steps_of(float weight, float step) {
  auto steps = static_cast<std::uint16_t>(std::min(weight / step, static_cast<float>(kMostWeightSteps)));
  while (steps < kMostWeightSteps && step * static_cast<float>(steps) < weight) ++steps;
  return std::max<std::uint16_t>(steps, 1);
}

/// From a sample to the one at a corner of its cell; as many back where that one is of a block behind.
constexpr int corner_step(int corner) {
  return (corner & 1) + kBlockEdge * (corner >> 1 & 1) + kBlockEdge * kBlockEdge * (corner >> 2);
}

/// last: bit a is set where sample s is the block's last one along axis a.
VertexPlace place_of(int s, int last, const CubeEdge& edge) {
  const int behind = edge.corner & last;
  const int sample = s + corner_step(edge.corner) - kBlockEdge * corner_step(behind);
  return {static_cast<std::uint16_t>(behind), static_cast<std::uint16_t>(3 * sample + edge.axis)};
}

}  // namespace

BlockMesher::BlockMesher(const SurfaceVolume& volume, std::span<const Pending> pending)
    : volume_(volume),
      pending_(pending),
      voxel_(static_cast<float>(volume.options().voxel)),
      min_weight_(steps_of(static_cast<float>(volume.options().min_weight), volume.units().weight)) {}

void BlockMesher::extract(const BlockPosition& at, BlockMesh& piece) {
  piece.edges = {};
  piece.vertices.clear();
  piece.triangles.clear();
  if (!find_blocks(at)) return;
  fill();
  add_vertices(at, piece);
  add_triangles(piece);
}

bool BlockMesher::find_blocks(const BlockPosition& at) {
  const BlockTable& blocks = volume_.blocks();
  bool any_inside = false, any_outside = false;
  for (int n = 0; n < 8; ++n) {  // its own cells end in the blocks behind it
    const int x = n & 1, y = n >> 1 & 1, z = n >> 2;
    const auto number = neighbour({at.x + x, at.y + y, at.z + z});
    around_[kOwn + static_cast<std::size_t>(x + 3 * y + 9 * z)] = number ? &blocks[*number] : nullptr;
    if (!number) continue;
    any_inside |= blocks.head(*number).any_inside;
    any_outside |= blocks.head(*number).any_outside;
  }
  if (around_[kOwn] == nullptr || !any_inside || !any_outside || !find_rows()) return false;
  for (int n = 0; n < 27; ++n) {
    const int x = n % 3 - 1, y = n / 3 % 3 - 1, z = n / 9 - 1;
    if (std::min({x, y, z}) >= 0) continue;
    const auto number = neighbour({at.x + x, at.y + y, at.z + z});
    around_[static_cast<std::size_t>(n)] = number ? &blocks[*number] : nullptr;
  }
  return true;
}

std::optional<std::uint32_t> BlockMesher::neighbour(const BlockPosition& at) const {
  const auto number = volume_.blocks().number_of(at);
  return number && !pending_.empty() && pending_[*number] == Pending::kOthers ? std::nullopt : number;
}

void BlockMesher::fill() {
  std::size_t to = 0;
  for (int z = -1; z < kBlockEdge + 2; ++z)
    for (int y = -1; y < kBlockEdge + 2; ++y, to += kPadded) fill_row(y, z, to);
}

/// The last sample of the block before, the eight of the block, and the first two of the block behind.
void BlockMesher::fill_row(int y, int z, std::size_t to) {
  const auto* blocks = &around_[static_cast<std::size_t>(((z + 8) / 8 * 3 + (y + 8) / 8) * 3)];
  const std::size_t row = sample_at(0, y, z);
  const auto copy = [&](const VoxelBlock* block, std::size_t from, std::size_t x) {
    distance_[to + x] = block != nullptr ? volume_.units().distance * block->distance[row + from] : 0;
    weight_[to + x] = block != nullptr ? volume_.units().weight * block->weight[row + from] : 0;
  };
  copy(blocks[0], kBlockEdge - 1, 0);
  Lanes distance{}, weight{};
  if (blocks[1] != nullptr) {
    distance = volume_.units().distance * real(load<LaneShort>(&blocks[1]->distance[row]));
    weight = volume_.units().weight * real(load<LaneUnsignedShort>(&blocks[1]->weight[row]));
  }
  std::memcpy(&distance_[to + 1], &distance, sizeof(distance));
  std::memcpy(&weight_[to + 1], &weight, sizeof(weight));
  copy(blocks[2], 0, kBlockEdge + 1);
  copy(blocks[2], 1, kBlockEdge + 2);
}

bool BlockMesher::find_rows() {
  unsigned any_inside = 0;
  for (int z = 0; z < kRows; ++z) {
    for (int y = 0; y < kRows; ++y) {
      const auto* blocks = &around_[kOwn + static_cast<std::size_t>(9 * (z / 8) + 3 * (y / 8))];
      const std::size_t first = sample_at(0, y, z);
      Row found;
      if (blocks[0] != nullptr) {
        found.known = bits_of(load<LaneUnsignedShort>(&blocks[0]->weight[first]) >= min_weight_);
        found.inside = bits_of(load<LaneShort>(&blocks[0]->distance[first]) < 0);
      }
      if (blocks[1] != nullptr) {
        found.known |= static_cast<unsigned>(blocks[1]->weight[first] >= min_weight_) << kBlockEdge;
        found.inside |= static_cast<unsigned>(blocks[1]->distance[first] < 0) << kBlockEdge;
      }
      rows_[static_cast<std::size_t>(z * kRows + y)] = found;
      any_inside |= found.inside & found.known;
    }
  }
  return any_inside != 0;
}

void BlockMesher::add_vertices(const BlockPosition& at, BlockMesh& piece) const {
  for (int r = 0; r < kBlockEdge * kBlockEdge; ++r) {
    const int y = r % kBlockEdge, z = r / kBlockEdge;
    const Row& here = row(y, z);
    const std::array<Row, 3> next{Row{here.known >> 1, here.inside >> 1}, row(y + 1, z), row(y, z + 1)};
    std::array<unsigned, 3> crossed{};
    for (std::size_t axis = 0; axis < 3; ++axis)
      crossed[axis] = here.known & next[axis].known & (here.inside ^ next[axis].inside) & kOfBlock;
    for (unsigned left = crossed[0] | crossed[1] | crossed[2]; left != 0; left &= left - 1) {
      const int x = std::countr_zero(left);
      const int s = r * kBlockEdge + x;
      for (int axis = 0; axis < 3; ++axis) {
        if ((crossed[static_cast<std::size_t>(axis)] >> x & 1U) == 0) continue;
        piece.edges.add(3 * s + axis);
        piece.vertices.push_back(vertex(at, s, axis));
      }
    }
  }
  piece.edges.finish();
}

SurfaceVertex BlockMesher::vertex(const BlockPosition& at, int s, int axis) const {
  const int i = padded_index(s % 8, s / 8 % 8, s / 64);
  const int j = i + kStep[static_cast<std::size_t>(axis)];
  const float di = distance_[static_cast<std::size_t>(i)];
  const float dj = distance_[static_cast<std::size_t>(j)];
  const float t = di / (di - dj);
  const Eigen::Vector3i sample(s % 8, s / 8 % 8, s / 64);
  Eigen::Vector3f grid = (kBlockEdge * Eigen::Vector3i(at.x, at.y, at.z) + sample).cast<float>();
  grid[axis] += t;
  SurfaceVertex v;
  v.position = grid * voxel_;
  const Eigen::Vector3f normal = (1 - t) * gradient(i) + t * gradient(j);
  v.normal = normal.norm() > 0 ? Eigen::Vector3f(normal.normalized()) : Eigen::Vector3f::UnitZ();
  const float weight = std::min(weight_[static_cast<std::size_t>(i)], weight_[static_cast<std::size_t>(j)]);
  v.sigma = voxel_ / std::sqrt(weight);
  v.colour = colour(s, axis, t);
  return v;
}

/// Of the nearer of the two samples that has one.
std::array<std::uint8_t, 3> BlockMesher::colour(int s, int axis, float t) const {
  SampleColour near = colour_of(*around_[kOwn], static_cast<std::size_t>(s));
  std::array<int, 3> at{s % 8, s / 8 % 8, s / 64};
  const auto along = static_cast<std::size_t>(axis);
  const bool is_behind = ++at[along] == kBlockEdge;
  const VoxelBlock* next = around_[kOwn + (is_behind ? std::array<std::size_t, 3>{1, 3, 9}[along] : 0)];
  const SampleColour far = colour_of(*next, sample_at(at[0], at[1], at[2]));
  if ((t > 0.5f && far != 0) || near == 0) near = far;
  const auto level = [near](int c) {
    return static_cast<std::uint8_t>((near >> (kColourBits * c) & kColourMask) / kColourSteps);
  };
  return {level(0), level(1), level(2)};
}

/// Central difference, or one-sided where a neighbour was never seen.
Eigen::Vector3f BlockMesher::gradient(int i) const {
  Eigen::Vector3f g;
  for (int a = 0; a < 3; ++a) {
    const auto at = static_cast<std::size_t>(i);
    const auto next = static_cast<std::size_t>(i + kStep[static_cast<std::size_t>(a)]);
    const auto previous = static_cast<std::size_t>(i - kStep[static_cast<std::size_t>(a)]);
    const bool has_next = weight_[next] > 0;
    const bool has_previous = weight_[previous] > 0;
    const float high = has_next ? distance_[next] : distance_[at];
    const float low = has_previous ? distance_[previous] : distance_[at];
    g[a] = has_next && has_previous ? 0.5f * (high - low) : high - low;
  }
  return g;
}

void BlockMesher::add_triangles(BlockMesh& piece) const {
  const auto& edges = cube_edges();
  for (int r = 0; r < kBlockEdge * kBlockEdge; ++r) {
    const int y = r % kBlockEdge, z = r / kBlockEdge;
    // In the order of a cell's corners, those at x + 1 left out.
    const std::array<Row, 4> rows{row(y, z), row(y + 1, z), row(y, z + 1), row(y + 1, z + 1)};
    unsigned known = ~0U, all_inside = ~0U, any_inside = 0;
    for (const Row& one : rows) {
      known &= one.known;
      all_inside &= one.inside;
      any_inside |= one.inside;
    }
    known &= known >> 1;
    const unsigned mixed = (any_inside | any_inside >> 1) & ~(all_inside & all_inside >> 1);
    for (unsigned left = known & mixed & kOfBlock; left != 0; left &= left - 1) {
      const int x = std::countr_zero(left);
      unsigned code = 0;
      for (std::size_t i = 0; i < 4; ++i) code |= (rows[i].inside >> x & 3U) << (2 * i);
      const int s = r * kBlockEdge + x;
      const int last = (x == kBlockEdge - 1) + 2 * (y == kBlockEdge - 1) + 4 * (z == kBlockEdge - 1);
      for (const auto& triangle : cube_triangles(code))
        piece.triangles.push_back({place_of(s, last, edges[triangle[0]]),
                                   place_of(s, last, edges[triangle[1]]),
                                   place_of(s, last, edges[triangle[2]])});
    }
  }
}

}  // namespace twofold
