#include "surface/voxel_block.hpp"

#include <algorithm>
#include <cstddef>

#include "surface/lanes.hpp"

namespace twofold {
namespace {

constexpr std::size_t kFirstSlots = 1024;

}  // namespace

BlockTable::BlockTable(const BlockTable& other) : heads_(other.heads_), slots_(other.slots_) {
  for (std::size_t b = 0; b < other.size(); ++b) {
    VoxelBlock& block = blocks_.add();
    block = other[b];
    if (block.colour == nullptr) continue;
    BlockColour& colour = colours_.add();
    colour = *block.colour;
    block.colour = &colour;
  }
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
    blocks_.add().at = at;  // the last that may throw
    slot = {at, static_cast<std::uint32_t>(size())};
    heads_.push_back({.at = at});
  }
  return slot.block;
}

void BlockTable::grow() {
  const std::size_t slots = std::max(kFirstSlots, 2 * slots_.size());
  heads_.reserve(slots / 2);  // a block that has a slot finds room for its head
  slots_.assign(slots, Slot{});
  for (std::size_t b = 0; b < size(); ++b)
    slots_[slot_of(heads_[b].at)] = {heads_[b].at, static_cast<std::uint32_t>(b)};
}

void BlockTable::set_samples(std::size_t i, const VoxelBlock& other) {
  VoxelBlock& own = blocks_[i];
  own.distance = other.distance;
  own.weight = other.weight;
  if (other.colour != nullptr)
    colour_for(own) = *other.colour;
  else if (own.colour != nullptr)
    own.colour->samples.fill(0);
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
  return blocks_.bytes() + colours_.bytes() + heads_.capacity() * sizeof(heads_[0]) +
         slots_.size() * sizeof(slots_[0]);
}

void BlockTable::clear() {
  blocks_.clear();
  colours_.clear();
  heads_.clear();
  slots_.clear();
}

}  // namespace twofold
