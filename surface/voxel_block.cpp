#include "surface/voxel_block.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <new>
#include <utility>

namespace twofold {
namespace {

constexpr std::size_t kFirstSlots = 1024;

}  // namespace

BlockTable::ChunkPointer BlockTable::new_chunk() {
  // All is written at once: pages that are asked for together cost half of what they do one by one.
  void* pages =
      mmap(nullptr, sizeof(Chunk), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
  if (pages == MAP_FAILED) throw std::bad_alloc();
  return ChunkPointer(new (pages) Chunk());
}

void BlockTable::ReturnPages::operator()(Chunk* chunk) const {
  std::destroy_at(chunk);
  (void)munmap(chunk, sizeof(Chunk));
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
  if (2 * size_ >= slots_.size()) grow();
  Slot& slot = slots_[slot_of(at)];
  if (slot.block == kFree) {
    if (size_ == kChunk * chunks_.size()) chunks_.push_back(new_chunk());
    slot = {at, static_cast<std::uint32_t>(size_)};
    (*this)[size_++].at = at;
  }
  return slot.block;
}

void BlockTable::grow() {
  slots_.assign(std::max(kFirstSlots, 2 * slots_.size()), Slot{});
  for (std::size_t b = 0; b < size_; ++b)
    slots_[slot_of((*this)[b].at)] = {(*this)[b].at, static_cast<std::uint32_t>(b)};
}

std::vector<const VoxelBlock*> BlockTable::sorted() const {
  std::vector<const VoxelBlock*> all;
  all.reserve(size_);
  for (std::size_t b = 0; b < size_; ++b) all.push_back(&(*this)[b]);
  std::sort(all.begin(), all.end(), [](const auto* a, const auto* b) { return a->at < b->at; });
  return all;
}

void BlockTable::clear() {
  chunks_.clear();
  size_ = 0;
  slots_.clear();
}

}  // namespace twofold
