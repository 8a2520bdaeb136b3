#include "surface/voxel_block.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>

#include "surface/lanes.hpp"

namespace twofold {
namespace {

constexpr std::size_t kFirstSlots = 1024;

}  // namespace

BlockTable::ChunkPointer BlockTable::new_chunk(bool large_page) {
  // Aligned to its size: what was mapped around it is given back.
  constexpr std::size_t kMapped = 2 * kChunkBytes;
  void* mapped = mmap(nullptr, kMapped, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapped == MAP_FAILED) throw std::bad_alloc();
  auto* begin = static_cast<std::byte*>(mapped);
  std::size_t space = kMapped;
  void* aligned = mapped;
  (void)std::align(kChunkBytes, kChunkBytes, aligned, space);
  auto* chunk = static_cast<std::byte*>(aligned);
  if (chunk != begin) (void)munmap(begin, static_cast<std::size_t>(chunk - begin));
  if (space != kChunkBytes) (void)munmap(chunk + kChunkBytes, space - kChunkBytes);
  // Advice: a kernel without large pages clears small ones, which cost half when they are asked for together.
  (void)madvise(chunk, kChunkBytes, large_page ? MADV_HUGEPAGE : MADV_NOHUGEPAGE);
  if (large_page) (void)madvise(chunk, kChunkBytes, MADV_POPULATE_WRITE);
  return ChunkPointer(reinterpret_cast<VoxelBlock*>(chunk));
}

void BlockTable::ReturnPages::operator()(VoxelBlock* chunk) const {
  static_assert(std::is_trivially_destructible_v<VoxelBlock>);
  (void)munmap(chunk, kChunkBytes);
}

std::size_t BlockTable::slot_of(const BlockPosition& at) const {
  const std::size_t mask = slots_.size() - 1;
  std::size_t slot = hash_of(at) & mask;
  while (slots_[slot].block != kFree && slots_[slot].at != at) slot = (slot + 1) & mask;
  return slot;
}

std::optional<std::uint32_t> BlockTable::number_of(const BlockPosition& at) const {
  if (slots_.empty()) return std::nullopt;
  const std::uint32_t block = slots_[slot_of(at)].block;
  return block == kFree ? std::nullopt : std::optional(block);
}

const VoxelBlock* BlockTable::find(const BlockPosition& at) const {
  const auto number = number_of(at);
  return number ? &(*this)[*number] : nullptr;
}

std::uint32_t BlockTable::find_or_add(const BlockPosition& at) {
  if (2 * size() >= slots_.size()) grow();
  Slot& slot = slots_[slot_of(at)];
  if (slot.block == kFree) {
    add_block().at = at;  // the last that may throw
    slot = {at, static_cast<std::uint32_t>(size())};
    heads_.push_back({.at = at});
  }
  return slot.block;
}

VoxelBlock& BlockTable::add_block() {
  const std::size_t in_chunk = size() % kChunk;
  if (in_chunk == 0) chunks_.push_back(new_chunk(!chunks_.empty()));
  return chunks_.back().get()[in_chunk];  // pages come cleared, and so is an empty block
}

void BlockTable::grow() {
  const std::size_t slots = std::max(kFirstSlots, 2 * slots_.size());
  heads_.reserve(slots / 2);  // a block that has a slot finds room for its head
  slots_.assign(slots, Slot{});
  for (std::size_t b = 0; b < size(); ++b)
    slots_[slot_of(heads_[b].at)] = {heads_[b].at, static_cast<std::uint32_t>(b)};
}

void BlockTable::set_changed(std::size_t i, std::uint64_t revision) {
  const VoxelBlock& block = (*this)[i];
  LaneShort inside{}, outside{};
  for (std::size_t s = 0; s < kBlockSamples; s += kLanes) {
    const LaneShort seen = load<LaneUnsignedShort>(&block.weight[s]) > 0;
    const LaneShort below = load<LaneShort>(&block.distance[s]) < 0;
    inside |= seen & below;
    outside |= seen & ~below;
  }
  heads_[i].any_inside = any(inside);
  heads_[i].any_outside = any(outside);
  heads_[i].revision = revision;
}

std::vector<const VoxelBlock*> BlockTable::sorted() const {
  std::vector<const VoxelBlock*> all;
  all.reserve(size());
  for (std::size_t b = 0; b < size(); ++b) all.push_back(&(*this)[b]);
  std::sort(all.begin(), all.end(), [](const auto* a, const auto* b) { return a->at < b->at; });
  return all;
}

std::size_t BlockTable::bytes() const {
  const std::size_t in_first = std::min(size(), kChunk) * sizeof(VoxelBlock);
  const std::size_t in_others = chunks_.size() > 1 ? (chunks_.size() - 1) * kChunkBytes : 0;
  return in_first + in_others + chunks_.size() * sizeof(chunks_[0]) + heads_.capacity() * sizeof(heads_[0]) +
         slots_.size() * sizeof(slots_[0]);
}

void BlockTable::clear() {
  chunks_.clear();
  heads_.clear();
  slots_.clear();
}

}  // namespace twofold
