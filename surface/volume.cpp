#include "surface/volume.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/check.hpp"
#include "surface/sampling.hpp"

namespace twofold {

SurfaceVolume::SurfaceVolume(const SurfaceOptions& options) : options_(options) {
  TWOFOLD_CHECK(options.invalid_reason().empty() && options.depth_noise > 0, "valid surface options");
}

std::optional<SurfaceDistance> SurfaceVolume::distance(const Vector3& x_v) const {
  return Sampler(blocks_, options_.voxel).at(x_v);
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
  VoxelBlock& block = blocks_.find_or_add(at);
  if (block.touched) return;
  block.touched = true;
  touched_.push_back(&block);
}

void SurfaceVolume::add(const SurfaceVolume& other, const SE3& T_v_o) {
  touched_.clear();
  for (const VoxelBlock* block : other.blocks_.sorted()) touch_overlapped(*block, T_v_o);
  const SE3 T_o_v = T_v_o.inverse();
  Sampler sampler(other.blocks_, options_.voxel);
  const auto most = static_cast<float>(options_.most_weight);
  for (VoxelBlock* block : touched_) {
    block->touched = false;
    for (int i = 0; i < kBlockSamples; ++i) {
      const auto s = static_cast<std::size_t>(i);
      const Vector3 grid(kBlockEdge * block->at.x + i % 8, kBlockEdge * block->at.y + i / 8 % 8,
                         kBlockEdge * block->at.z + i / 64);
      const auto sample = sampler.at(T_o_v * Vector3(grid * options_.voxel));
      if (!sample) continue;
      const auto w = static_cast<float>(sample->weight);
      const float sum = block->weight[s] + w;
      block->distance[s] += (static_cast<float>(sample->distance) - block->distance[s]) * w / sum;
      const auto colour = sampler.colour();
      for (std::size_t c = 0; c < 3; ++c) {
        std::uint16_t& own = block->colour[c][s];
        own = static_cast<std::uint16_t>(own + (colour[c] - own) * w / sum);
      }
      block->weight[s] = std::min(sum, most);
    }
  }
}

}  // namespace twofold
