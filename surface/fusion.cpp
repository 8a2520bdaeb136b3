// SurfaceVolume::fuse: what a depth image says of the samples of blocks.
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/right_of_way.hpp"
#include "surface/fusion_view.hpp"
#include "surface/lanes.hpp"
#include "surface/volume.hpp"

namespace twofold {
namespace {

constexpr float kColourBand = 2.0f * kDistanceSteps;
constexpr float kReadingShare = 0.2f;  // of max_weight: what one reading, however near, weighs at most
constexpr float kFreeShare = 0.1f;     // of max_weight: what the sight of free space weighs
// Of max_weight: what is left of a sample's weight when it was taken for the inside of something that is seen
// through. One wrong reading moves the surface by less than a voxel then, and four sights carve away whatever
// was seen before.
constexpr float kContradictedShare = 0.5f;

/// Eight readings, each kind together.
struct PixelLanes {
  Lanes depth, nearest, distance_per_depth;
  LaneIndex colour_and_facing;
};

/// Whole readings are loaded, and turned by shuffling: a load a number would take most of fusion's time.
inline PixelLanes read_pixels(const PixelReading* pixels, const LaneIndex& index) {
  using Four = float __attribute__((vector_size(sizeof(PixelReading))));
  std::array<std::uint32_t, kLanes> offset;  // [bytes]
  const LaneIndex bytes = index * static_cast<int>(sizeof(PixelReading));
  std::memcpy(offset.data(), &bytes, sizeof(bytes));
  const auto* from = reinterpret_cast<const char*>(pixels);
  std::array<Lanes, 4> pair;  // readings i and i + 4
  for (std::size_t i = 0; i < 4; ++i)
    pair[i] = __builtin_shufflevector(load<Four>(from + offset[i]), load<Four>(from + offset[i + 4]), 0, 1, 2,
                                      3, 4, 5, 6, 7);
  const Lanes low01 = __builtin_shufflevector(pair[0], pair[1], 0, 8, 1, 9, 4, 12, 5, 13);
  const Lanes high01 = __builtin_shufflevector(pair[0], pair[1], 2, 10, 3, 11, 6, 14, 7, 15);
  const Lanes low23 = __builtin_shufflevector(pair[2], pair[3], 0, 8, 1, 9, 4, 12, 5, 13);
  const Lanes high23 = __builtin_shufflevector(pair[2], pair[3], 2, 10, 3, 11, 6, 14, 7, 15);
  return {__builtin_shufflevector(low01, low23, 0, 1, 8, 9, 4, 5, 12, 13),
          __builtin_shufflevector(low01, low23, 2, 3, 10, 11, 6, 7, 14, 15),
          __builtin_shufflevector(high01, high23, 0, 1, 8, 9, 4, 5, 12, 13),
          reinterpret_cast<LaneIndex>(__builtin_shufflevector(high01, high23, 2, 3, 10, 11, 6, 7, 14, 15))};
}

/// Where the samples of a block stand in the image: (u z, v z, z) of the first and of the steps along x, y
/// and z, where u and v are half a pixel more, to be cut off. These are linear, so that samples cost
/// additions.
struct BlockPose {
  Eigen::Vector3f first, dx, dy, dz;  ///< [px m, px m, m]
  float truncation = 0;               ///< [m] at the block's depth
};

BlockPose pose_of(const FusionView& view, const SE3& T_c_v, const VoxelBlock& block) {
  Eigen::Matrix3f K;
  K << view.fx, 0, view.cx + 0.5f, 0, view.fy, view.cy + 0.5f, 0, 0, 1;
  BlockPose pose;
  const Vector3 origin(block.at.x, block.at.y, block.at.z);
  pose.first = K * (T_c_v * Vector3(origin * (kBlockEdge * static_cast<double>(view.voxel)))).cast<float>();
  const Eigen::Matrix3f steps = K * view.R_c_v * view.voxel;
  pose.dx = steps.col(0);
  pose.dy = steps.col(1);
  pose.dz = steps.col(2);
  pose.truncation = view.truncation_at(pose.first.z() + 0.5f * kBlockEdge * steps.row(2).sum());
  return pose;
}

/// What holds for all samples of a block, told by the tiles that it covers in the image.
struct BlockBounds {
  bool in_image = true;  ///< at least partly
  bool whole_in_image = false;
  float last = 1e9f;         ///< samples farther than this are hidden [m]
  float first_free = -1e9f;  ///< samples nearer than this are free [m]
};

BlockBounds bounds_of(const FusionView& view, const DepthView& images, const BlockPose& pose) {
  constexpr float kLast = kBlockEdge - 1;
  constexpr float kRounding = 0.1f;  // [px]: far more than sums differ by
  constexpr Lanes kX{0, kLast, 0, kLast, 0, kLast, 0, kLast}, kY{0, 0, kLast, kLast, 0, 0, kLast, kLast},
      kZ{0, 0, 0, 0, kLast, kLast, kLast, kLast};
  const auto corners = [&](int a) {
    return pose.first[a] + kX * pose.dx[a] + kY * pose.dy[a] + kZ * pose.dz[a];
  };
  const Lanes z = corners(2);
  BlockBounds bounds;
  if (least(z) <= kLeastDepth) return bounds;
  const Lanes inverse = kOne / z;
  const Lanes u = corners(0) * inverse;
  const Lanes v = corners(1) * inverse;
  const float left = least(u), right = largest(u), top = least(v), bottom = largest(v);
  bounds.in_image = right >= 0 && bottom >= 0 && left < view.width && top < view.height;
  if (!bounds.in_image) return bounds;
  bounds.whole_in_image =
      left >= 0 && top >= 0 && right < view.width - kRounding && bottom < view.height - kRounding;
  const int x0 = static_cast<int>(std::max(left, 0.0f)) / kDepthTile;
  const int x1 = static_cast<int>(std::min(right, view.width - 1)) / kDepthTile;
  const int y0 = static_cast<int>(std::max(top, 0.0f)) / kDepthTile;
  const int y1 = static_cast<int>(std::min(bottom, view.height - 1)) / kDepthTile;
  DepthTile all{0, 1e9f, 1e9f};
  for (int y = y0; y <= y1; ++y) {
    const auto* tiles = images.tiles.ptr<DepthTile>(y);
    for (int x = x0; x <= x1; ++x) {
      all.farthest = std::max(all.farthest, tiles[x].farthest);
      all.nearest = std::min(all.nearest, tiles[x].nearest);
      all.least_distance_per_depth =
          std::min(all.least_distance_per_depth, tiles[x].least_distance_per_depth);
    }
  }
  bounds.last = all.farthest + pose.truncation;
  if (bounds.whole_in_image) bounds.first_free = all.nearest - pose.truncation / all.least_distance_per_depth;
  return bounds;
}

struct RowUpdate {
  Lanes distance;  ///< new value for the average [steps]
  Lanes weight;    ///< [steps]; 0: the view says nothing
  LaneIndex free;  ///< not 0: samples that the view sees through
  LaneIndex near;  ///< samples that take part in the surface's colour
  LaneIndex colour;
};

/// The eight rows of samples with the same z in the block.
struct Layer {
  Layer(const BlockPose& pose, const BlockBounds& bounds, int number) {
    const auto along = [&](int a) {
      return (pose.first[a] + kCount * pose.dy[a]) + static_cast<float>(number) * pose.dz[a];
    };
    const Lanes z_first = along(2);
    const Lanes z_last = z_first + (kLanes - 1) * pose.dx.z();
    store(u, along(0));
    store(v, along(1));
    store(z, z_first);
    store(hidden, smaller(z_first, z_last) > bounds.last);
    store(free, larger(z_first, z_last) < bounds.first_free);
  }

  std::array<float, kLanes> u, v, z;              ///< of each row's first sample, as BlockPose has them
  std::array<std::int32_t, kLanes> hidden, free;  ///< not 0: all of the row's samples are

 private:
  template <class Array, class Vector>
  static void store(Array& to, const Vector& lanes) {
    std::memcpy(to.data(), &lanes, sizeof(lanes));
  }
};

/// What samples are compared with, in the units they are kept in.
struct RowScale {
  RowScale(const FusionView& view, const SampleUnits& units, const BlockPose& pose)
      : step{pose.dx.x() * kCount, pose.dx.y() * kCount, pose.dx.z() * kCount},
        truncation(pose.truncation),
        behind(1 / (pose.truncation - view.voxel)),
        distance(1 / units.distance),
        max_weight(kReadingShare * kMostWeightSteps / 255),
        weight(view.voxel * view.voxel / (view.noise * view.noise) / units.weight / 255) {}

  std::array<Lanes, 3> step;  ///< from the row's first sample to the others
  float truncation, behind, distance, max_weight, weight;
};

/// Row y of a layer. Weights are those at the samples' depths, which are the readings' but for the
/// truncation.
template <bool kWholeInImage>
inline void measure_row(const FusionView& view, const RowScale& scale, const PixelReading* pixels,
                        const Layer& layer, std::size_t y, RowUpdate& row) {
  const Lanes z = layer.z[y] + scale.step[2];
  const Lanes inverse = kOne / (kWholeInImage ? z : larger(z, kZero + kLeastDepth));
  Lanes u = (layer.u[y] + scale.step[0]) * inverse;
  Lanes v = (layer.v[y] + scale.step[1]) * inverse;
  LaneIndex seen;
  if constexpr (!kWholeInImage) {
    seen = (z > kLeastDepth) & (u >= 0) & (v >= 0) & (u < view.width) & (v < view.height);
    u = seen ? u : kZero;
    v = seen ? v : kZero;
  }
  const PixelLanes at = read_pixels(pixels, whole(v) * view.stride + whole(u));
  const Lanes in_depth = at.depth - z;
  const Lanes s = in_depth * at.distance_per_depth;
  const LaneIndex in_band = (at.depth > 0) & (in_depth >= -scale.truncation) & (s <= scale.truncation);
  // Free: all pixels around see farther than this, so that the rim of a thing is not worn away.
  const LaneIndex is_free = (at.nearest - z) * at.distance_per_depth > scale.truncation;
  // Behind the surface readings count less and less, or thin things would be carved from the other side.
  const Lanes behind = smaller(kOne, (in_depth + scale.truncation) * scale.behind);
  const Lanes squared = inverse * inverse;
  const Lanes facing = real((at.colour_and_facing >> 24) & 255);
  const Lanes weight = facing * behind * smaller(scale.weight * squared * squared, kZero + scale.max_weight);
  const Lanes banded = in_band ? weight : kZero;
  row.distance = scale.distance * (is_free ? kZero + scale.truncation : s);
  row.weight = is_free ? kZero + kFreeShare * kMostWeightSteps : banded;
  row.free = is_free;
  if constexpr (!kWholeInImage) {
    row.weight = seen ? row.weight : kZero;
    row.free &= seen;
  }
  row.near = (row.weight > 0) & (row.distance < kColourBand) & (row.distance > -kColourBand);
  row.colour = at.colour_and_facing;
}

/// Colours of samples within two voxels of the surface. share: of the new value in each average; a sample's
/// first colour is taken whole, whatever its distance was known by before.
inline void update_colours(const RowUpdate& row, const Lanes& share, SampleColour* colours) {
  const auto before = load<LaneIndex>(colours);
  const Lanes own_share = row.near ? (before == 0 ? kOne : share) : kZero;
  LaneIndex after{};
  for (int c = 0; c < 3; ++c) {
    const Lanes old = real((before >> (kColourBits * c)) & static_cast<int>(kColourMask));
    const Lanes seen = kColourSteps * real((row.colour >> (8 * c)) & 255);
    after |= whole(old + (seen - old) * own_share + 0.5f) << (kColourBits * c);
  }
  std::memcpy(colours, &after, sizeof(after));
}

/// Running averages of eight samples; what was seen once does not go back to weight 0.
template <bool kColours>
inline void update_row(const RowUpdate& row, std::size_t first, BlockTable& blocks, VoxelBlock& block) {
  std::int16_t* distances = &block.distance[first];
  std::uint16_t* weights = &block.weight[first];
  Lanes average = real(load<LaneShort>(distances));
  Lanes known = real(load<LaneUnsignedShort>(weights));
  const LaneIndex contradicted = row.free & (average < 0);
  known = contradicted ? smaller(known, kZero + kContradictedShare * kMostWeightSteps) : known;
  const Lanes sum = known + row.weight;
  const Lanes share = row.weight / larger(sum, kZero + 1e-6f);
  if constexpr (kColours) {
    if (any(row.near)) update_colours(row, share, &blocks.colour_for(block).samples[first]);
  }
  average += (row.distance - average) * share;
  constexpr float kToPositive = 32768;  // conversion cuts off toward 0
  const LaneShort average_steps =
      narrow(whole(average + (kToPositive + 0.5f)) - static_cast<int>(kToPositive));
  const Lanes bounded = smaller(sum + 0.5f, kZero + kMostWeightSteps);
  const LaneUnsignedShort weight_steps = narrow_unsigned(whole(sum > 0 ? larger(bounded, kOne) : kZero));
  std::memcpy(distances, &average_steps, sizeof(average_steps));
  std::memcpy(weights, &weight_steps, sizeof(weight_steps));
}

/// Nothing but free space, seen more than once: carving has nothing more to do here.
bool is_all_free(const VoxelBlock& block, const FusionView& view, const SampleUnits& units) {
  const auto far = static_cast<std::int16_t>(0.9f * view.truncation / units.distance);
  const auto known = static_cast<std::uint16_t>(kFreeShare * view.max_weight / units.weight);
  constexpr std::size_t kLayer = kBlockEdge * kBlockEdge;  // most blocks show in the first that they are not
  for (std::size_t layer = 0; layer < kBlockSamples; layer += kLayer) {
    LaneShort other{};
    for (std::size_t i = layer; i < layer + kLayer; i += kLanes) {
      other |= load<LaneShort>(&block.distance[i]) <= far;
      other |= load<LaneUnsignedShort>(&block.weight[i]) <= known;
    }
    if (any(other)) return false;
  }
  return true;
}

/// Free as far as samples can tell: seeing it once more changes nothing.
bool is_settled(const std::int16_t* distances, const std::uint16_t* weights, std::int16_t free) {
  return !any((load<LaneShort>(distances) != free) | (load<LaneUnsignedShort>(weights) != kMostWeightSteps));
}

/// Blocks lie anywhere in memory: the next one is fetched while one is worked on.
constexpr int kRowsOfLine = 64 / (kLanes * static_cast<int>(sizeof(std::int16_t)));
inline void fetch_line(const VoxelBlock& block, int row) {
  const auto first = static_cast<std::size_t>(row) * kLanes;
  __builtin_prefetch(&block.distance[first], 1);
  __builtin_prefetch(&block.weight[first], 1);
  if (block.colour == nullptr) return;
  const SampleColour* colours = &block.colour->samples[first];
  __builtin_prefetch(colours, 1);
  __builtin_prefetch(colours + kRowsOfLine * kLanes / 2, 1);
}

/// One depth image, and what it says of every block.
struct BlockUpdate {
  const FusionView& view;
  const DepthView& images;
  const SampleUnits& units;
  BlockTable& blocks;

  /// Whether any sample took part.
  bool operator()(const SE3& T_c_v, BlockHead& head, VoxelBlock& block, const VoxelBlock& next) const {
    const BlockPose pose = pose_of(view, T_c_v, block);
    const BlockBounds bounds = bounds_of(view, images, pose);
    if (!bounds.in_image) return false;
    const bool any = bounds.whole_in_image ? update_rows<true>(pose, bounds, block, next)
                                           : update_rows<false>(pose, bounds, block, next);
    if (any) head.all_free = is_all_free(block, view, units);
    return any;
  }

  template <bool kWholeInImage>
  bool update_rows(const BlockPose& pose, const BlockBounds& bounds, VoxelBlock& block,
                   const VoxelBlock& next) const {
    const RowScale scale(view, units, pose);
    const auto* pixels = images.pixels.ptr<PixelReading>(0);
    const auto free = static_cast<std::int16_t>(std::lrint(scale.truncation * scale.distance));
    RowUpdate row;
    const RowUpdate free_row{kZero + scale.truncation * scale.distance,
                             kZero + kFreeShare * kMostWeightSteps,
                             ~LaneIndex{},
                             {},
                             {}};
    bool any_row = false;
    for (int z = 0; z < kBlockEdge; ++z) {
      const Layer layer(pose, bounds, z);
      for (std::size_t y = 0; y < kBlockEdge; ++y) {
        const int r = kBlockEdge * z + static_cast<int>(y);
        if (r % kRowsOfLine == 0) fetch_line(next, r);
        if (layer.hidden[y] != 0) continue;
        const auto first = static_cast<std::size_t>(r) * kLanes;
        if (layer.free[y] != 0) {
          if (is_settled(&block.distance[first], &block.weight[first], free)) continue;
          update_row<false>(free_row, first, blocks, block);
          any_row = true;
          continue;
        }
        measure_row<kWholeInImage>(view, scale, pixels, layer, y, row);
        if (!any(row.weight > 0)) continue;
        update_row<true>(row, first, blocks, block);
        any_row = true;
      }
    }
    return any_row;
  }
};

}  // namespace

void SurfaceVolume::fuse(const DepthView& view, const SE3& T_c_v) {
  const FusionView f(view, options_, T_c_v);
  collect_blocks(view, T_c_v);
  add_blocks_to_carve(view, T_c_v);
  const BlockUpdate update{f, view, units_, blocks_};
  ++revision_;
  for (std::size_t n = 0; n < touched_.size(); ++n) {
    const std::size_t last = touched_.size() - 1;
    const VoxelBlock& next = blocks_[touched_[std::min(n + 1, last)]];
    __builtin_prefetch(&blocks_[touched_[std::min(n + 2, last)]]);  // position and colour
    const std::uint32_t b = touched_[n];
    if (update(T_c_v, blocks_.head(b), blocks_[b], next)) blocks_.set_changed(b, revision_);
    make_way();
  }
}

}  // namespace twofold
