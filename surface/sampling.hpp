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
    if (!(grid.cwiseAbs().maxCoeff() < kFarthest)) return std::nullopt;
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
    nearest_ = {base.x() + (f.x() > 0.5), base.y() + (f.y() > 0.5), base.z() + (f.z() > 0.5)};
    return result;
  }

  /// Colour of the sample nearest to where `at` found something last, red, green, blue in 1/256.
  [[nodiscard]] std::array<float, 3> colour() {
    const Eigen::Vector3i& n = nearest_;
    const VoxelBlock* block = block_at({n.x() >> 3, n.y() >> 3, n.z() >> 3});
    const auto c =
        colour_of(*block, static_cast<std::size_t>(((n.z() & 7) * 8 + (n.y() & 7)) * 8 + (n.x() & 7)));
    return {static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])};
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
  Eigen::Vector3i nearest_{0, 0, 0};
};

}  // namespace twofold
