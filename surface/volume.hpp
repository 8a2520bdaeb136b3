#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/se3.hpp"
#include "surface/depth_view.hpp"
#include "surface/options.hpp"
#include "surface/voxel_block.hpp"

namespace twofold {

/// The signed distance at one position, linear between the eight samples around it.
struct SurfaceDistance {
  double distance = 0;        ///< [m], positive outside, truncated
  Vector3 gradient{0, 0, 0};  ///< d distance / d position
  double weight = 0;          ///< the least of the eight
};

class Resampler;

/// By how many whole blocks of that edge [m] a frame is shifted, if it is neither turned nor shifted by a
/// part of one: samples of both grids are the same positions then.
[[nodiscard]] std::optional<BlockPosition> shift_in_blocks(const SE3& T, double edge);

/// A truncated signed distance field in sparse blocks  (Curless and Levoy, SIGGRAPH 1996; blocks found by
/// hash: Niessner et al., SIGGRAPH Asia 2013). Sample g stands at g * voxel in the volume's frame v.
///
/// A sample's weight stands for the information of its distance in units of 1 / voxel^2: voxel / sqrt(weight)
/// is an upper estimate of its standard deviation. Each reading adds voxel^2 / sigma(z)^2, but less the more
/// aslant the surface is seen and the farther the sample is behind it, and at most a fifth of max_weight;
/// each sight of free space adds a tenth of max_weight, and first takes what is above half of max_weight from
/// a sample that was the inside of something. The sum ends at max_weight, so that the estimate is never below
/// voxel / sqrt(max_weight). Same calls, same bytes. One thread at a time.
class SurfaceVolume {
 public:
  /// options must be valid; depth_noise above 0.
  explicit SurfaceVolume(const SurfaceOptions& options);

  /// Adds a depth image, taken from T_c_v. Samples up to the truncation behind a reading get its distance
  /// along the ray, times the cosine between ray and normal; those farther in front are free: what stood
  /// there before is carved away.
  void fuse(const DepthView& view, const SE3& T_c_v);
  /// Adds another volume of the same options, whose frame lies at T_v_o in this one: resampled linearly, or
  /// sample by sample where T_v_o is a shift_in_blocks.
  void add(const SurfaceVolume& other, const SE3& T_v_o);
  void clear() {
    blocks_.clear();
    cleared_ = ++revision_;
  }
  /// Stands for another one from here on, as if that had been cleared and filled anew: revisions go on.
  void replace(const SurfaceVolume& other) {
    cleared_ = revision_ = std::max(revision_, other.revision_) + 1;
  }

  /// Blocks of this volume that a block of another one, whose frame lies at T_v_o, has a say in; those that
  /// were missing are there then, empty. Numbers, each once.
  [[nodiscard]] std::vector<std::uint32_t> add_overlapped(const BlockPosition& of_other, const SE3& T_v_o);
  /// Makes a block what other volumes say, added in this order.
  /// @param begun  what those say that come before them; null: there are none
  void compose_block(std::uint32_t block, const VoxelBlock* begun, std::span<Resampler* const> others);

  /// Nothing where one of the eight samples around it was never seen.
  [[nodiscard]] std::optional<SurfaceDistance> distance(const Vector3& x_v) const;

  [[nodiscard]] const SurfaceOptions& options() const { return options_; }
  [[nodiscard]] const BlockTable& blocks() const { return blocks_; }
  [[nodiscard]] const SampleUnits& units() const { return units_; }
  [[nodiscard]] std::size_t bytes() const { return blocks_.bytes(); }
  /// Counts the calls that may have changed a sample; blocks have that of their last change.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  /// Revision of the last call of clear; 0: there was none.
  [[nodiscard]] std::uint64_t cleared() const { return cleared_; }

 private:
  /// Blocks that the view has something to say about, each once.
  void collect_blocks(const DepthView& view, const SE3& T_c_v);
  void touch(const BlockPosition& at);
  void touch_none();
  void add_blocks_to_carve(const DepthView& view, const SE3& T_c_v);

  SurfaceOptions options_;
  SampleUnits units_;
  BlockTable blocks_;
  std::uint64_t revision_ = 0, cleared_ = 0;
  std::vector<std::uint32_t> touched_;    ///< blocks that one fusion changes
  std::vector<std::uint8_t> is_touched_;  ///< of every block, whether it is among these
};

}  // namespace twofold
