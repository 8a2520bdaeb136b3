#include "surface/sampling.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "surface/lanes.hpp"

namespace twofold {
namespace {

constexpr double kRounding = 1e-3;  // [samples]: far more than floats of the cube's size differ by
constexpr float kColourBand = 2.5f * kDistanceSteps;
constexpr float kToPositive = 32768;  // conversion cuts off toward 0

/// Neighbours along x of eight samples.
struct LanePair {
  LaneIndex first, second;
};
inline LanePair read_pairs(const std::uint32_t* from, const std::array<std::int32_t, kLanes>& index) {
  using Two = std::uint64_t __attribute__((vector_size(16)));
  const auto two = [&](std::size_t i) {
    return Two{load<std::uint64_t>(from + index[i]), load<std::uint64_t>(from + index[i + 1])};
  };
  const auto low = reinterpret_cast<LaneIndex>(__builtin_shufflevector(two(0), two(2), 0, 1, 2, 3));
  const auto high = reinterpret_cast<LaneIndex>(__builtin_shufflevector(two(4), two(6), 0, 1, 2, 3));
  return {__builtin_shufflevector(low, high, 0, 2, 4, 6, 8, 10, 12, 14),
          __builtin_shufflevector(low, high, 1, 3, 5, 7, 9, 11, 13, 15)};
}
inline LaneIndex weight_of(const LaneIndex& sample) {
  return (sample >> 16) & 0xffff;
}
inline Lanes distance_of(const LaneIndex& sample) {
  return real((sample << 16) >> 16);
}

/// Eight samples between those of the cube, and which of the cube's they are nearest to.
struct Resampled {
  Lanes distance;  ///< [steps]
  LaneIndex weight, nearest;
};

/// Where eight samples lie in cells of the cube, and what stands at the cells' corners: by twos along x, of
/// which the first two lie at the smaller z, the first and the third at the smaller y.
struct Cells {
  std::array<LanePair, 4> corners;
  std::array<Lanes, 3> at;  ///< within the cell, 0 .. 1

  [[nodiscard]] Lanes linear() const {
    std::array<Lanes, 4> along_x;
    for (std::size_t c = 0; c < 4; ++c) {
      const Lanes first = distance_of(corners[c].first);
      along_x[c] = first + at[0] * (distance_of(corners[c].second) - first);
    }
    const Lanes y0 = along_x[0] + at[1] * (along_x[1] - along_x[0]);
    const Lanes y1 = along_x[2] + at[1] * (along_x[3] - along_x[2]);
    return y0 + at[2] * (y1 - y0);
  }
  /// The corner that each sample is nearest to.
  [[nodiscard]] LaneIndex nearest() const {
    const LaneIndex far_x = at[0] > 0.5f, far_y = at[1] > 0.5f, far_z = at[2] > 0.5f;
    const auto along_x = [&](std::size_t c) { return far_x != 0 ? corners[c].second : corners[c].first; };
    const LaneIndex z0 = far_y != 0 ? along_x(1) : along_x(0);
    const LaneIndex z1 = far_y != 0 ? along_x(3) : along_x(2);
    return far_z != 0 ? z1 : z0;
  }
  /// All eight.
  [[nodiscard]] LaneIndex are_seen() const {
    LaneIndex seen = LaneIndex{} - 1;
    for (const LanePair& pair : corners) seen &= (weight_of(pair.first) > 0) & (weight_of(pair.second) > 0);
    return seen;
  }
  /// The mean of those that were seen, with the shares that they have in linear(); one of them was.
  [[nodiscard]] Lanes mean_of_seen() const {
    Lanes sum{}, share{};
    for (std::size_t c = 0; c < 4; ++c) {
      const Lanes in_yz = ((c & 1) != 0 ? at[1] : kOne - at[1]) * ((c >> 1) != 0 ? at[2] : kOne - at[2]);
      const auto take = [&](const LaneIndex& sample, const Lanes& own_share) {
        const Lanes part = weight_of(sample) > 0 ? own_share : kZero;
        sum += part * distance_of(sample);
        share += part;
      };
      take(corners[c].first, in_yz * (kOne - at[0]));
      take(corners[c].second, in_yz * at[0]);
    }
    return sum / larger(share, kZero + 1e-6f);
  }
};

/// Cells whose lowest corners stand beside each other in a row, as most do where a loop has turned a volume
/// by a degree or two: whole rows of corners are loaded.
inline void read_row(const std::uint32_t* first, int row, int layer, Cells& cells) {
  for (int c = 0; c < 4; ++c) {
    const std::uint32_t* from = first + (c >> 1) * layer + (c & 1) * row;
    cells.corners[static_cast<std::size_t>(c)] = {load<LaneIndex>(from), load<LaneIndex>(from + 1)};
  }
}
inline void read_scattered(const std::uint32_t* cube, const LaneIndex& base, int row, int layer,
                           Cells& cells) {
  std::array<std::int32_t, kLanes> index;
  std::memcpy(index.data(), &base, sizeof(base));
  for (int c = 0; c < 4; ++c)
    cells.corners[static_cast<std::size_t>(c)] = read_pairs(cube + (c >> 1) * layer + (c & 1) * row, index);
}

/// Of a cube with so many samples along x, and along x and y. Weights are those of the nearest samples, 0
/// where these were never seen: or each time that samples are taken to another grid, what is known would lose
/// a sample all around, and be known less.
inline Resampled resample(const std::uint32_t* cube, int row, int layer, const std::array<Lanes, 3>& at) {
  const LaneIndex x = whole(at[0]), y = whole(at[1]), z = whole(at[2]);
  Cells cells{{}, {at[0] - real(x), at[1] - real(y), at[2] - real(z)}};
  const LaneIndex base = z * layer + y * row + x;
  constexpr LaneIndex kBeside{0, 1, 2, 3, 4, 5, 6, 7};
  if (any((base - kBeside) ^ base[0]))
    read_scattered(cube, base, row, layer, cells);
  else
    read_row(cube + base[0], row, layer, cells);
  Resampled result{};
  const auto step = [](const Lanes& f, int by) { return (f > 0.5f) & by; };
  result.nearest = base + step(cells.at[0], 1) + step(cells.at[1], row) + step(cells.at[2], layer);
  result.weight = weight_of(cells.nearest());
  if (!any(result.weight)) return result;
  result.distance = cells.linear();
  const LaneIndex all_seen = cells.are_seen();
  if (any((all_seen == 0) & (result.weight > 0)))
    result.distance = all_seen != 0 ? result.distance : cells.mean_of_seen();
  return result;
}

/// Adds eight samples to the running averages of those of a block from `first` on.
/// @return  what each new one is worth in its average; 0: nothing
inline Lanes average_row(const Lanes& new_distance, const LaneIndex& new_weight, std::size_t first,
                         VoxelBlock& block) {
  const Lanes weight = real(new_weight);
  const Lanes before = real(load<LaneShort>(&block.distance[first]));
  const Lanes sum = real(load<LaneUnsignedShort>(&block.weight[first])) + weight;
  const Lanes share = weight / larger(sum, kOne);
  const Lanes average = before + (new_distance - before) * share;
  const LaneIndex steps = whole(average + (kToPositive + 0.5f)) - static_cast<int>(kToPositive);
  const LaneShort distances = narrow(new_weight > 0 ? steps : whole(before));
  const LaneUnsignedShort weights = narrow_unsigned(whole(smaller(sum, kZero + kMostWeightSteps)));
  std::memcpy(&block.distance[first], &distances, sizeof(distances));
  std::memcpy(&block.weight[first], &weights, sizeof(weights));
  return share;
}

/// Samples that take part in the surface's colour.
inline LaneIndex near_surface(const Lanes& distance, const LaneIndex& weight) {
  return (weight > 0) & (distance < kColourBand) & (distance > -kColourBand);
}

/// Adds to the running averages of eight samples' colours; a sample's first one is taken whole.
/// @param colours  0: none
/// @param share    of the new one in each average
void add_colours(const LaneIndex& colours, const Lanes& share, SampleColour* own) {
  const auto before = load<LaneIndex>(own);
  LaneIndex average{};
  for (int shift = 0; shift < 3 * kColourBits; shift += kColourBits) {
    const Lanes old = real(before >> shift & static_cast<int>(kColourMask));
    const Lanes added = real(colours >> shift & static_cast<int>(kColourMask));
    average |= whole(old + (added - old) * share + 0.5f) << shift;
  }
  const LaneIndex first = before == 0 ? colours : average;
  const LaneIndex after = colours == 0 ? before : first;
  std::memcpy(own, &after, sizeof(after));
}

/// @param rows  of the cube's samples, eight by eight; null: without colours
LaneIndex read_colours(const SampleColour* const* rows, const LaneIndex& index, const LaneIndex& wanted) {
  LaneIndex colours{};
  for (std::size_t i = 0; i < kLanes; ++i) {
    if (wanted[i] == 0) continue;
    const auto sample = static_cast<std::uint32_t>(index[i]);
    const SampleColour* row = rows[sample / kBlockEdge];
    if (row != nullptr) colours[i] = static_cast<std::int32_t>(row[sample % kBlockEdge]);
  }
  return colours;
}

}  // namespace

Resampler::Resampler(const SurfaceVolume& from, const SE3& T_f_t)
    : from_(from.blocks()),
      voxel_(from.options().voxel),
      T_f_t_(T_f_t),
      steps_(T_f_t.rotation().cast<float>()),
      shift_(shift_in_blocks(T_f_t, kBlockEdge * voxel_)) {}

bool Resampler::add_to(BlockTable& to, VoxelBlock& block) {
  if (shift_) return add_same_samples(to, block);
  const Vector3 origin(block.at.x, block.at.y, block.at.z);
  const Vector3 first = T_f_t_ * Vector3(origin * (kBlockEdge * voxel_)) / voxel_;
  if (!fill(first)) return false;
  const Vector3 begin(low_.x() & ~7, low_.y(), low_.z());
  const Eigen::Vector3f in_cube = (first - begin).cast<float>();
  bool any = false;
  for (int r = 0; r < kBlockEdge * kBlockEdge; ++r) {
    const int y = r % kBlockEdge, z = r / kBlockEdge;
    const Eigen::Vector3f at =
        in_cube + static_cast<float>(y) * steps_.col(1) + static_cast<float>(z) * steps_.col(2);
    any |= add_row(at, static_cast<std::size_t>(r) * kBlockEdge, to, block);
  }
  return any;
}

bool Resampler::add_same_samples(BlockTable& to, VoxelBlock& block) {
  const VoxelBlock* from =
      from_.find({block.at.x + shift_->x, block.at.y + shift_->y, block.at.z + shift_->z});
  if (from == nullptr) return false;
  bool any_seen = false;
  for (std::size_t first = 0; first < kBlockSamples; first += kLanes) {
    const LaneIndex weight = wide(load<LaneUnsignedShort>(&from->weight[first]));
    if (!any(weight)) continue;
    any_seen = true;
    const Lanes distance = real(load<LaneShort>(&from->distance[first]));
    const Lanes share = average_row(distance, weight, first, block);
    const LaneIndex near = near_surface(distance, weight);
    if (from->colour == nullptr || !any(near)) continue;
    add_colours(load<LaneIndex>(&from->colour->samples[first]) & near, share,
                &to.colour_for(block).samples[first]);
  }
  return any_seen;
}

bool Resampler::fill(const Vector3& first) {
  Vector3 low = first, high = first;
  for (int a = 0; a < 3; ++a) {
    const Vector3 edge = (kBlockEdge - 1) * steps_.col(a).cast<double>();
    low += edge.cwiseMin(0);
    high += edge.cwiseMax(0);
  }
  if (!(low.cwiseAbs().maxCoeff() < 1e9 && high.cwiseAbs().maxCoeff() < 1e9)) return false;
  low_ = (low.array() - kRounding).floor().cast<int>();
  high_ = (high.array() + kRounding).floor().cast<int>() + 1;
  bool any = false;
  for (int n = 0; n < 27; ++n) {
    const BlockPosition at{(low_.x() >> 3) + n % 3, (low_.y() >> 3) + n / 3 % 3, (low_.z() >> 3) + n / 9};
    const bool is_met = at.x <= high_.x() >> 3 && at.y <= high_.y() >> 3 && at.z <= high_.z() >> 3;
    blocks_[static_cast<std::size_t>(n)] = is_met ? from_.find(at) : nullptr;
    any = any || blocks_[static_cast<std::size_t>(n)] != nullptr;
  }
  if (!any) return false;
  for (int z = low_.z(); z <= high_.z(); ++z) {
    for (int y = low_.y(); y <= high_.y(); ++y) {
      const auto n =
          static_cast<std::size_t>((((z >> 3) - (low_.z() >> 3)) * 3 + (y >> 3) - (low_.y() >> 3)) * 3);
      fill_row({blocks_[n], blocks_[n + 1], blocks_[n + 2]}, y, z);
    }
  }
  return true;
}

void Resampler::fill_row(const std::array<const VoxelBlock*, 3>& blocks, int y, int z) {
  auto to = static_cast<std::size_t>(((z - low_.z()) * kCube + y - low_.y()) * kRow);
  const auto row = static_cast<std::size_t>(((z & 7) * kBlockEdge + (y & 7)) * kBlockEdge);
  const auto reached = static_cast<std::size_t>((high_.x() >> 3) - (low_.x() >> 3) + 1);
  for (std::size_t n = 0; n < reached; ++n, to += kBlockEdge) {
    LaneIndex samples{};
    const SampleColour* colours = nullptr;
    if (blocks[n] != nullptr) {
      const LaneIndex weight = wide(load<LaneUnsignedShort>(&blocks[n]->weight[row]));
      const LaneIndex distance = wide(load<LaneShort>(&blocks[n]->distance[row]));
      samples = weight << 16 | (distance & 0xffff);
      if (blocks[n]->colour != nullptr) colours = &blocks[n]->colour->samples[row];
    }
    std::memcpy(&cube_[to], &samples, sizeof(samples));
    colours_[to / kBlockEdge] = colours;
  }
}

/// Samples `first` to first + 7 of a block, whose first one lies `at` in the cube.
bool Resampler::add_row(const Eigen::Vector3f& at, std::size_t first, BlockTable& to,
                        VoxelBlock& block) const {
  const auto along = [&](int a) { return at[a] + steps_(a, 0) * kCount; };
  const Resampled found = resample(cube_.data(), kRow, kRow * kCube, {along(0), along(1), along(2)});
  if (!any(found.weight)) return false;
  const Lanes share = average_row(found.distance, found.weight, first, block);
  const LaneIndex near = near_surface(found.distance, found.weight);
  if (!any(near)) return true;
  add_colours(read_colours(colours_.data(), found.nearest, near), share,
              &to.colour_for(block).samples[first]);
  return true;
}

}  // namespace twofold
