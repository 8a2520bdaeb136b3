#include "surface/volume.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.hpp"
#include "surface/sampling.hpp"

namespace twofold {

SurfaceVolume::SurfaceVolume(const SurfaceOptions& options) : options_(options) {
  TWOFOLD_CHECK(options.invalid_reason().empty() && options.depth_noise > 0, "valid surface options");
  units_.distance = static_cast<float>(options.voxel) / kDistanceSteps;
  units_.weight = static_cast<float>(options.max_weight) / kMostWeightSteps;
}

std::optional<SurfaceDistance> SurfaceVolume::distance(const Vector3& x_v) const {
  return Sampler(blocks_, units_, options_.voxel).at(x_v);
}

std::optional<BlockPosition> shift_in_blocks(const SE3& T, double edge) {
  constexpr double kNegligible = 1e-9;  // far less than a sample, however far away
  const Vector3 shift = T.translation() / edge;
  const Vector3 whole = shift.array().round();
  if (!(whole.cwiseAbs().maxCoeff() < 1e9)) return std::nullopt;
  const bool is_turned = (T.rotation() - Matrix3::Identity()).cwiseAbs().maxCoeff() > kNegligible;
  if (is_turned || (shift - whole).cwiseAbs().maxCoeff() > kNegligible) return std::nullopt;
  return BlockPosition{static_cast<std::int32_t>(whole.x()), static_cast<std::int32_t>(whole.y()),
                       static_cast<std::int32_t>(whole.z())};
}

std::vector<std::uint32_t> SurfaceVolume::add_overlapped(const BlockPosition& of_other, const SE3& T_v_o) {
  if (const auto shift = shift_in_blocks(T_v_o, kBlockEdge * options_.voxel))
    return {blocks_.find_or_add({of_other.x + shift->x, of_other.y + shift->y, of_other.z + shift->z})};
  // In blocks. The other block begins at the last sample of the block before: what lies between two blocks
  // rests on both.
  constexpr double kHalf = 0.5 * (1 + 1.0 / kBlockEdge);
  constexpr double kOwnHalf = 0.5 * (1 - 1.0 / kBlockEdge);
  constexpr double kNegligible = 1e-6;
  const Vector3 shift = T_v_o.translation() / (kBlockEdge * options_.voxel);
  const Matrix3 R_v_o = T_v_o.rotation();
  const Vector3 middle_o = Vector3(of_other.x, of_other.y, of_other.z) + Vector3::Constant(1 - kHalf);
  const Vector3 middle = R_v_o * middle_o + shift;
  const Vector3 half = R_v_o.cwiseAbs() * Vector3::Constant(kHalf + kNegligible);
  const Eigen::Vector3i first = (middle - half).array().floor().cast<int>();
  const Eigen::Vector3i last = (middle + half).array().floor().cast<int>();
  // Two boxes are apart, too, when they are so along an axis of the turned one.
  const Vector3 reach_o =
      (R_v_o.transpose().cwiseAbs() * Vector3::Constant(kOwnHalf)).array() + kHalf + kNegligible;
  std::vector<std::uint32_t> overlapped;
  for (int z = first.z(); z <= last.z(); ++z)
    for (int y = first.y(); y <= last.y(); ++y)
      for (int x = first.x(); x <= last.x(); ++x) {
        const Vector3 away = Vector3(x, y, z) + Vector3::Constant(kOwnHalf) - middle;
        const Vector3 away_o = R_v_o.transpose() * away;
        if ((away_o.array().abs() > reach_o.array()).any()) continue;
        overlapped.push_back(blocks_.find_or_add({x, y, z}));
      }
  return overlapped;
}

void SurfaceVolume::compose_block(std::uint32_t block, const VoxelBlock* begun,
                                  std::span<Resampler* const> others) {
  blocks_.set_samples(block, begun != nullptr ? *begun : VoxelBlock());
  VoxelBlock& own = blocks_[block];
  for (Resampler* other : others) (void)other->add_to(blocks_, own);
  blocks_.head(block).all_free = false;
  blocks_.set_changed(block, ++revision_);
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
  std::vector<std::uint32_t> reached;
  for (std::size_t b = 0; b < other.blocks_.size(); ++b) {
    const std::vector<std::uint32_t> some = add_overlapped(other.blocks_.head(b).at, T_v_o);
    reached.insert(reached.end(), some.begin(), some.end());
  }
  std::sort(reached.begin(), reached.end());
  reached.erase(std::unique(reached.begin(), reached.end()), reached.end());
  ++revision_;
  Resampler resampler(other, T_v_o.inverse());
  for (const std::uint32_t b : reached) {
    if (!resampler.add_to(blocks_, blocks_[b])) continue;
    blocks_.head(b).all_free = false;
    blocks_.set_changed(b, revision_);
  }
}

}  // namespace twofold
