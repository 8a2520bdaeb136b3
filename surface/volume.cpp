#include "surface/volume.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/check.hpp"
#include "surface/sampling.hpp"

namespace twofold {

SurfaceVolume::SurfaceVolume(const SurfaceOptions& options) : options_(options) {
  TWOFOLD_CHECK(options.invalid_reason().empty() && options.depth_noise > 0, "valid surface options");
  units_.distance = static_cast<float>(options.voxel) / kDistanceSteps;
  units_.weight = static_cast<float>(options.most_weight) / kMostWeightSteps;
}

std::optional<SurfaceDistance> SurfaceVolume::distance(const Vector3& x_v) const {
  return Sampler(blocks_, units_, options_.voxel).at(x_v);
}

Occupancy SurfaceVolume::occupancy(const Vector3& x_v) const {
  const auto found = distance(x_v);
  if (!found) return Occupancy::kUnknown;
  return found->distance > 0 ? Occupancy::kFree : Occupancy::kOccupied;
}

/// Blocks of this volume that a block of another one reaches into.
void SurfaceVolume::touch_overlapped(const VoxelBlock& block, const SE3& T_v_o) {
  const double edge = kBlockEdge * options_.voxel;
  Vector3 low = Vector3::Constant(1e300);
  Vector3 high = -low;
  for (int c = 0; c < 8; ++c) {
    const Vector3 corner(block.at.x + (c & 1), block.at.y + (c >> 1 & 1), block.at.z + (c >> 2));
    const Vector3 x_v = T_v_o * Vector3(corner * edge) / edge;
    low = low.cwiseMin(x_v);
    high = high.cwiseMax(x_v);
  }
  const Eigen::Vector3i first = low.array().floor().cast<int>();
  const Eigen::Vector3i last = high.array().floor().cast<int>();
  for (int z = first.z(); z <= last.z(); ++z)
    for (int y = first.y(); y <= last.y(); ++y)
      for (int x = first.x(); x <= last.x(); ++x) touch({x, y, z});
}

void SurfaceVolume::touch(const BlockPosition& at) {
  const std::uint32_t block = blocks_.find_or_add(at);
  if (block >= is_touched_.size()) is_touched_.resize(blocks_.size(), 0);
  if (is_touched_[block] != 0) return;
  is_touched_[block] = 1;
  touched_.push_back(block);
}

void SurfaceVolume::touch_none() {
  touched_.clear();
  is_touched_.assign(blocks_.size(), 0);
}

void SurfaceVolume::add(const SurfaceVolume& other, const SE3& T_v_o) {
  touch_none();
  for (const VoxelBlock* block : other.blocks_.sorted()) touch_overlapped(*block, T_v_o);
  const SE3 T_o_v = T_v_o.inverse();
  Sampler sampler(other.blocks_, other.units_, options_.voxel);
  for (const std::uint32_t touched : touched_) {
    VoxelBlock* block = &blocks_[touched];
    block->all_free = false;
    for (int i = 0; i < kBlockSamples; ++i) {
      const auto s = static_cast<std::size_t>(i);
      const Vector3 grid(kBlockEdge * block->at.x + i % 8, kBlockEdge * block->at.y + i / 8 % 8,
                         kBlockEdge * block->at.z + i / 64);
      const auto sample = sampler.at(T_o_v * Vector3(grid * options_.voxel));
      if (!sample) continue;
      const auto w = static_cast<float>(sample->weight) / units_.weight;
      const float sum = block->weight[s] + w;
      const float before = block->distance[s];
      const float now = before + (static_cast<float>(sample->distance) / units_.distance - before) * w / sum;
      block->distance[s] = static_cast<std::int16_t>(std::lrint(now));
      const auto colour = sampler.colour();
      for (std::size_t c = 0; c < 3; ++c) {
        std::uint16_t& own = block->colour[c][s];
        own = static_cast<std::uint16_t>(own + (colour[c] - own) * w / sum);
      }
      block->weight[s] = static_cast<std::uint16_t>(std::clamp<long>(std::lrint(sum), 1, kMostWeightSteps));
    }
  }
}

}  // namespace twofold
