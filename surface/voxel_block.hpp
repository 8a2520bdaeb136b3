#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "geometry/types.hpp"
#include "surface/page_pool.hpp"

namespace twofold {

inline constexpr int kBlockEdge = 8;  ///< samples along an edge of a block
inline constexpr int kBlockSamples = kBlockEdge * kBlockEdge * kBlockEdge;

/// Which block of a volume: it holds the samples (8 x .. 8 x + 7, 8 y .. , 8 z .. ).
struct BlockPosition {
  std::int32_t x = 0, y = 0, z = 0;
  friend auto operator<=>(const BlockPosition&,
                          const BlockPosition&) = default;  // NOLINT(modernize-use-nullptr): no 0 here
};

/// Primes of Teschner et al., Optimized Spatial Hashing (VMV 2003), then mixed, since tables take low
/// bits.
[[nodiscard]] inline std::size_t hash_of(const BlockPosition& at) {
  const auto part = [](std::int32_t c, std::uint64_t prime) {
    return static_cast<std::uint64_t>(static_cast<std::uint32_t>(c)) * prime;
  };
  const std::uint64_t h = part(at.x, 73856093) ^ part(at.y, 19349669) ^ part(at.z, 83492791);
  return static_cast<std::size_t>((h * 0x9e3779b97f4a7c15ULL) >> 24);
}

/// What one step of a sample's whole numbers is worth.
struct SampleUnits {
  float distance = 1;  ///< [m]
  float weight = 1;
};

/// Sixteen bits hold distances of 64 voxels either way, in steps far below what any sensor tells apart.
inline constexpr int kDistanceSteps = 512;      ///< a voxel
inline constexpr int kMostDistanceVoxels = 60;  ///< that any truncation may have
/// Weights end at this number of steps.
inline constexpr int kMostWeightSteps = 65535;

/// Red, green and blue of a sample, from the lowest of ten bits each on, in steps of 1 / kColourSteps; 0:
/// none yet.
using SampleColour = std::uint32_t;
inline constexpr int kColourSteps = 4;
inline constexpr int kColourBits = 10;
inline constexpr std::uint32_t kColourMask = (1U << kColourBits) - 1;

struct BlockColour {
  alignas(64) std::array<SampleColour, kBlockSamples> samples{};
};

/// 8^3 samples of a truncated signed distance; sample (x, y, z) of it is entry (z * 8 + y) * 8 + x. Whole
/// numbers of SampleUnits: what a volume costs is mostly the way of its samples to and from memory. Colours,
/// which are half of it, only blocks near a surface have.
struct VoxelBlock {
  BlockPosition at;
  BlockColour* colour = nullptr;                                   ///< BlockTable::colour_for; null: none yet
  alignas(64) std::array<std::int16_t, kBlockSamples> distance{};  ///< positive outside the surface
  alignas(64) std::array<std::uint16_t, kBlockSamples> weight{};   ///< 0: never seen
};

[[nodiscard]] inline SampleColour colour_of(const VoxelBlock& block, std::size_t i) {
  return block.colour != nullptr ? block.colour->samples[i] : 0;
}

/// What is asked of all blocks one after the other. Blocks themselves lie pages apart: a glance at each of
/// them costs more than the arithmetic.
struct BlockHead {
  BlockPosition at;
  bool all_free = false;       ///< every sample is well known to be free
  bool any_inside = false;     ///< of the surface: a sample that was seen
  bool any_outside = false;    ///< likewise
  std::uint64_t revision = 0;  ///< of the volume (SurfaceVolume::revision) when a sample changed last
};

/// The blocks there are, found by position: a hash table with open addresses. Blocks are never taken out one
/// by one, so that they are all there where a surface ever was. References to blocks stay valid until clear,
/// those to heads until the next find_or_add.
class BlockTable {
 public:
  BlockTable() = default;
  BlockTable(const BlockTable& other);
  BlockTable& operator=(const BlockTable& other) { return *this = BlockTable(other); }
  BlockTable(BlockTable&&) = default;
  BlockTable& operator=(BlockTable&&) = default;
  ~BlockTable() = default;

  [[nodiscard]] const VoxelBlock* find(const BlockPosition& at) const;
  [[nodiscard]] VoxelBlock* find(const BlockPosition& at) {
    return const_cast<VoxelBlock*>(std::as_const(*this).find(at));
  }
  [[nodiscard]] std::optional<std::uint32_t> number_of(const BlockPosition& at) const;
  /// Its number: blocks are counted from 0 in the order they were added.
  std::uint32_t find_or_add(const BlockPosition& at);

  [[nodiscard]] std::size_t size() const { return heads_.size(); }
  [[nodiscard]] VoxelBlock& operator[](std::size_t i) { return blocks_[i]; }
  [[nodiscard]] const VoxelBlock& operator[](std::size_t i) const { return blocks_[i]; }
  /// Of a block of this table, which has a colour then.
  [[nodiscard]] BlockColour& colour_for(VoxelBlock& block) {
    if (block.colour == nullptr) block.colour = &colours_.add();
    return *block.colour;
  }
  [[nodiscard]] BlockHead& head(std::size_t i) { return heads_[i]; }
  [[nodiscard]] const BlockHead& head(std::size_t i) const { return heads_[i]; }
  /// Those of another table's block, and its colours.
  void set_samples(std::size_t i, const VoxelBlock& other);
  /// A block's samples have changed: its head says so, and on which sides of the surface they are.
  void set_changed(std::size_t i, std::uint64_t revision);
  /// In the order of their positions.
  [[nodiscard]] std::vector<const VoxelBlock*> sorted() const;
  void clear();
  [[nodiscard]] std::size_t bytes() const;

 private:
  static constexpr std::uint32_t kFree = 0xffffffff;
  /// Positions stand here too, so that they are compared without fetching blocks.
  struct Slot {
    BlockPosition at;
    std::uint32_t block = kFree;
  };
  /// Slot of the block, or the free one where it would go; there are slots.
  [[nodiscard]] std::size_t slot_of(const BlockPosition& at) const;
  void grow();

  PagePool<VoxelBlock> blocks_;
  PagePool<BlockColour> colours_;
  std::vector<BlockHead> heads_;
  std::vector<Slot> slots_;  ///< a power of two, at most half of them taken
};

}  // namespace twofold
