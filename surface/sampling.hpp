#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "surface/volume.hpp"

namespace twofold {

/// Reads a field of blocks between its samples. Keeps the block it read last, since neighbours are asked for
/// one after the other.
class Sampler {
 public:
  /// blocks must outlive the sampler, and not change.
  Sampler(const BlockTable& blocks, const SampleUnits& units, double voxel)
      : blocks_(&blocks), units_(units), voxel_(voxel) {}

  /// Nothing where one of the eight samples around x_v [m] was never seen.
  [[nodiscard]] std::optional<SurfaceDistance> at(const Vector3& x_v) {
    const Vector3 grid = x_v / voxel_;
    if (!(grid.array().abs() < kFarthest).all()) return std::nullopt;  // NaN, too
    const Eigen::Vector3i base = grid.array().floor().cast<int>();
    const Vector3 f = grid - base.cast<double>();
    std::array<double, 8> d{};
    SurfaceDistance result;
    result.weight = 1e300;
    for (int c = 0; c < 8; ++c) {
      const int x = base.x() + (c & 1), y = base.y() + (c >> 1 & 1), z = base.z() + (c >> 2);
      const VoxelBlock* block = block_at({x >> 3, y >> 3, z >> 3});
      const auto s = static_cast<std::size_t>(((z & 7) * 8 + (y & 7)) * 8 + (x & 7));
      if (block == nullptr || block->weight[s] == 0) return std::nullopt;
      d[static_cast<std::size_t>(c)] = units_.distance * static_cast<double>(block->distance[s]);
      result.weight = std::min<double>(result.weight, units_.weight * static_cast<double>(block->weight[s]));
    }
    interpolate(d, f, result);
    return result;
  }

 private:
  static constexpr double kFarthest = 1e9;  // samples from the origin: farther, whole numbers end

  const VoxelBlock* block_at(const BlockPosition& at) {
    if (!any_ || last_at_ != at) {
      any_ = true;
      last_at_ = at;
      last_ = blocks_->find(at);
    }
    return last_;
  }
  void interpolate(const std::array<double, 8>& d, const Vector3& f, SurfaceDistance& result) const {
    const auto mix = [](double a, double b, double t) { return a + t * (b - a); };
    const auto along_x = [&](std::size_t c) { return mix(d[c], d[c + 1], f.x()); };
    const double y0 = mix(along_x(0), along_x(2), f.y());
    const double y1 = mix(along_x(4), along_x(6), f.y());
    result.distance = mix(y0, y1, f.z());
    const auto step_x = [&](std::size_t c) { return d[c + 1] - d[c]; };
    result.gradient = {
        mix(mix(step_x(0), step_x(2), f.y()), mix(step_x(4), step_x(6), f.y()), f.z()) / voxel_,
        mix(along_x(2) - along_x(0), along_x(6) - along_x(4), f.z()) / voxel_, (y1 - y0) / voxel_};
  }

  const BlockTable* blocks_;
  SampleUnits units_;
  double voxel_;
  bool any_ = false;
  BlockPosition last_at_;
  const VoxelBlock* last_ = nullptr;
};

/// Reads a volume at the samples of another one of the same options, whose grid is turned and shifted against
/// it: linearly between the eight samples around, or those of them that were ever seen, with the weight of
/// the nearest one, and not where that was never seen. Grids that are a shift_in_blocks apart have the same
/// samples, which are taken as they are.
class Resampler {
 public:
  /// @param from   must outlive the resampler, and not change
  /// @param T_f_t  of the other volume's frame in that of `from`
  Resampler(const SurfaceVolume& from, const SE3& T_f_t);

  /// Adds what is there to the running averages of a block of the other volume's table. Colours take part
  /// within two and a half voxels of the surface, where there is one.
  /// @return  whether anything is there
  bool add_to(BlockTable& to, VoxelBlock& block);

 private:
  static constexpr int kCube = 16;  // samples that a turned block reaches over along an axis, at most
  static constexpr int kRow = 3 * kBlockEdge;  // along x whole rows of blocks are copied

  bool add_same_samples(BlockTable& to, VoxelBlock& block);
  /// Copies the samples around a block, whose first one lies at `first`, of those samples from low_ on.
  bool fill(const Vector3& first);
  void fill_row(const std::array<const VoxelBlock*, 3>& blocks, int y, int z);
  bool add_row(const Eigen::Vector3f& at, std::size_t first, BlockTable& to, VoxelBlock& block) const;

  const BlockTable& from_;
  double voxel_;
  SE3 T_f_t_;
  Eigen::Matrix3f steps_;               ///< columns: along x, y and z of the other grid [samples]
  std::optional<BlockPosition> shift_;  ///< T_f_t_, if it is one
  Eigen::Vector3i low_{0, 0, 0}, high_{0, 0, 0};
  std::array<const VoxelBlock*, 27> blocks_{};  ///< from that of low_ on
  /// Weight in the upper half, distance in the lower one; x fastest, from the block of low_ on.
  alignas(32) std::array<std::uint32_t, kRow * kCube * kCube> cube_{};
  std::array<const SampleColour*, kRow / kBlockEdge * kCube * kCube> colours_{};  ///< of its rows of eight
};

}  // namespace twofold
