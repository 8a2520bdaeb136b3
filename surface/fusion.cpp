// SurfaceVolume::fuse: which blocks a depth image says something about, and what it says of their samples.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "surface/volume.hpp"

namespace twofold {
namespace {

constexpr int kLanes = kBlockEdge;  // samples of a row, updated together
constexpr int kPixelStep = 2;       // between readings that blocks are made for: a block is wider
constexpr float kLeastDepth = 0.05f;
constexpr float kReadingShare = 0.2f;  // of most_weight: what one reading, however near, weighs at most
constexpr float kFreeShare = 0.1f;     // of most_weight: what the sight of free space weighs

// Eight numbers that one instruction works on, where the processor can: as an extension of the language that
// GCC and Clang share, since neither makes vectors of these short loops by itself. Comparisons give -1 or 0
// for each lane.
using Lane = float __attribute__((vector_size(kLanes * sizeof(float))));
using LaneIndex = std::int32_t __attribute__((vector_size(kLanes * sizeof(std::int32_t))));

using LaneShort = std::uint16_t __attribute__((vector_size(kLanes * sizeof(std::uint16_t))));

inline Lane larger(const Lane& a, const Lane& b) {
  return a > b ? a : b;
}
inline Lane smaller(const Lane& a, const Lane& b) {
  return a < b ? a : b;
}
constexpr Lane kCount{0, 1, 2, 3, 4, 5, 6, 7};
constexpr Lane kZero{};
constexpr Lane kOne = kZero + 1;

/// What fusion knows of the sensor and the view, as floats.
struct FusionView {
  Eigen::Matrix3f R_c_v;
  float fx, fy, cx, cy, width, height;
  std::int32_t stride;
  float voxel, truncation, noise, most_weight;
};

/// sigma = noise z^2; distances are kept up to three of it.
float truncation_at(const FusionView& view, float z) {
  return std::max(view.truncation, 3 * view.noise * z * z);
}

/// What a pixel says, together in memory, because samples ask for it all.
struct PixelReading {
  float depth = 0;    ///< [m]; 0: none
  float nearest = 0;  ///< of the pixels around
  float slant = 0;    ///< distance from the surface over difference of depths
  float weight = 0;
};

/// Distances along the ray are longer than those from the surface by the cosine between ray and normal.
std::vector<PixelReading> pixel_readings(const FusionView& view, const DepthView& images) {
  std::vector<PixelReading> pixels(images.depth.total());
  const float most = kReadingShare * view.most_weight;
  std::size_t i = 0;
  for (int y = 0; y < images.depth.rows; ++y) {
    const auto* depth = images.depth.ptr<float>(y);
    const auto* nearest = images.nearest.ptr<float>(y);
    const auto* facing = images.facing.ptr<float>(y);
    const float ry = (static_cast<float>(y) - view.cy) / view.fy;
    for (int x = 0; x < images.depth.cols; ++x, ++i) {
      const float rx = (static_cast<float>(x) - view.cx) / view.fx;
      const float in_sigmas = view.voxel / std::max(view.noise * depth[x] * depth[x], 1e-9f);
      pixels[i] = {depth[x], nearest[x], facing[x] * std::sqrt(1 + rx * rx + ry * ry),
                   facing[x] * std::min(in_sigmas * in_sigmas, most)};
    }
  }
  return pixels;
}

template <class Vector>
inline Vector load(const void* from) {
  Vector lanes;
  std::memcpy(&lanes, from, sizeof(Vector));
  return lanes;
}

/// Eight readings, each kind together.
struct PixelLanes {
  Lane depth, nearest, slant, weight;
};

/// Whole readings are loaded, and turned by shuffling: a load a number would take most of fusion's time.
inline PixelLanes read_pixels(const PixelReading* pixels, const LaneIndex& index) {
  using Four = float __attribute__((vector_size(sizeof(PixelReading))));
  std::array<Four, kLanes> r;
  for (int i = 0; i < kLanes; ++i) r[static_cast<std::size_t>(i)] = load<Four>(&pixels[index[i]]);
  std::array<std::array<Four, 4>, 2> turned;
  for (std::size_t half = 0; half < 2; ++half) {
    const Four* q = &r[4 * half];
    const Four low01 = __builtin_shufflevector(q[0], q[1], 0, 4, 1, 5);
    const Four high01 = __builtin_shufflevector(q[0], q[1], 2, 6, 3, 7);
    const Four low23 = __builtin_shufflevector(q[2], q[3], 0, 4, 1, 5);
    const Four high23 = __builtin_shufflevector(q[2], q[3], 2, 6, 3, 7);
    turned[half] = {__builtin_shufflevector(low01, low23, 0, 1, 4, 5),
                    __builtin_shufflevector(low01, low23, 2, 3, 6, 7),
                    __builtin_shufflevector(high01, high23, 0, 1, 4, 5),
                    __builtin_shufflevector(high01, high23, 2, 3, 6, 7)};
  }
  const auto joined = [&](std::size_t kind) {
    return __builtin_shufflevector(turned[0][kind], turned[1][kind], 0, 1, 2, 3, 4, 5, 6, 7);
  };
  return {joined(0), joined(1), joined(2), joined(3)};
}

struct RowUpdate {
  Lane distance;  ///< new value for the average
  Lane weight;    ///< 0: the view says nothing
  LaneIndex pixel;
};

/// The row of samples from x_c on, each `step` farther.
inline void measure_row(const FusionView& view, const PixelReading* pixels, const Eigen::Vector3f& x_c,
                        const Eigen::Vector3f& step, RowUpdate& row) {
  const Lane z = x_c.z() + kCount * step.z();
  const Lane inverse = kOne / larger(z, kZero + kLeastDepth);
  const Lane u = view.fx * (x_c.x() + kCount * step.x()) * inverse + (view.cx + 0.5f);
  const Lane v = view.fy * (x_c.y() + kCount * step.y()) * inverse + (view.cy + 0.5f);
  const LaneIndex seen = (z > kLeastDepth) & (u >= 0) & (v >= 0) & (u < view.width) & (v < view.height);
  row.pixel = __builtin_convertvector(seen ? v : kZero, LaneIndex) * view.stride +
              __builtin_convertvector(seen ? u : kZero, LaneIndex);
  const PixelLanes at = read_pixels(pixels, row.pixel);
  const Lane truncation = larger(kZero + view.truncation, 3 * view.noise * at.depth * at.depth);
  const Lane in_depth = at.depth - z;
  const Lane s = in_depth * at.slant;
  const LaneIndex in_band = (at.depth > 0) & (in_depth >= -truncation) & (s <= truncation);
  // Free: all pixels around see farther than this, so that the rim of a thing is not worn away.
  const LaneIndex is_free = (at.nearest - z) * at.slant > truncation;
  // Behind the surface readings count less and less, or thin things would be carved from the other side.
  const Lane behind = smaller(kOne, (in_depth + truncation) / (truncation - view.voxel));
  const Lane banded = in_band ? behind * at.weight : kZero;
  row.distance = is_free ? truncation : s;
  row.weight = seen ? (is_free ? kZero + kFreeShare * view.most_weight : banded) : kZero;
}

inline bool any(const LaneIndex& lanes) {
  std::int32_t sum = 0;
  for (int i = 0; i < kLanes; ++i) sum |= lanes[i];
  return sum != 0;
}

inline void update_row(const RowUpdate& row, float most, float* distances, float* weights) {
  Lane distance = load<Lane>(distances);
  const Lane sum = load<Lane>(weights) + row.weight;
  distance += (row.distance - distance) * (row.weight / larger(sum, kZero + 1e-12f));
  const Lane weight = smaller(sum, kZero + most);
  std::memcpy(distances, &distance, sizeof(Lane));
  std::memcpy(weights, &weight, sizeof(Lane));
}

/// Red, green and blue of every pixel in the bytes of one number, from the lowest on; empty without an image.
std::vector<std::int32_t> packed_colours(const cv::Mat& image) {
  std::vector<std::int32_t> packed;
  packed.reserve(image.total());
  for (int y = 0; y < image.rows; ++y) {
    const auto* pixel = image.ptr<std::uint8_t>(y);
    for (int x = 0; x < image.cols; ++x) {
      if (image.channels() == 3) {
        packed.push_back(pixel[3 * x + 2] | pixel[3 * x + 1] << 8 | pixel[3 * x] << 16);
      } else {
        packed.push_back(pixel[x] * 0x010101);
      }
    }
  }
  return packed;
}

/// Colours of samples within two voxels of the surface; before update_row, which changes the weights.
inline void update_colours(const FusionView& view, const std::int32_t* colours, const RowUpdate& row,
                           std::size_t first, VoxelBlock& block) {
  const LaneIndex near =
      (row.weight > 0) & (row.distance < 2 * view.voxel) & (row.distance > -2 * view.voxel);
  if (!any(near)) return;
  LaneIndex seen;
  for (int i = 0; i < kLanes; ++i) seen[i] = colours[row.pixel[i]];
  const Lane weight = near ? row.weight : kZero;
  const Lane share = weight / larger(load<Lane>(&block.weight[first]) + weight, kZero + 1e-12f);
  for (std::size_t c = 0; c < 3; ++c) {
    std::uint16_t* channel = &block.colour[c][first];
    const LaneIndex bits = (seen >> static_cast<int>(8 * c)) & 255;
    const Lane before = __builtin_convertvector(load<LaneShort>(channel), Lane);
    const Lane after = before + (256 * __builtin_convertvector(bits, Lane) - before) * share;
    const auto rounded = __builtin_convertvector(__builtin_convertvector(after, LaneIndex), LaneShort);
    std::memcpy(channel, &rounded, sizeof(rounded));
  }
}

/// Nothing but free space, known as well as it can be: carving has nothing more to do here.
bool is_all_free(const VoxelBlock& block, const FusionView& view) {
  const float far = 0.9f * view.truncation, known = kFreeShare * view.most_weight;
  LaneIndex other{};
  for (std::size_t i = 0; i < kBlockSamples; i += kLanes)
    other |= (load<Lane>(&block.distance[i]) <= far) | (load<Lane>(&block.weight[i]) <= known);
  return !any(other);
}

void update_block(const FusionView& view, const PixelReading* pixels, const std::int32_t* colours,
                  const SE3& T_c_v, VoxelBlock& block) {
  const Vector3 origin(block.at.x, block.at.y, block.at.z);
  const Eigen::Vector3f x_c =
      (T_c_v * Vector3(origin * (kBlockEdge * static_cast<double>(view.voxel)))).cast<float>();
  const Eigen::Vector3f dx = view.R_c_v.col(0) * view.voxel;
  const Eigen::Vector3f dy = view.R_c_v.col(1) * view.voxel;
  const Eigen::Vector3f dz = view.R_c_v.col(2) * view.voxel;
  RowUpdate row;
  for (int r = 0; r < kBlockEdge * kBlockEdge; ++r) {
    const Eigen::Vector3f first_c =
        x_c + static_cast<float>(r % kBlockEdge) * dy + static_cast<float>(r / kBlockEdge) * dz;
    measure_row(view, pixels, first_c, dx, row);
    if (!any(row.weight > 0)) continue;
    const auto first = static_cast<std::size_t>(r) * kLanes;
    if (colours != nullptr) update_colours(view, colours, row, first, block);
    update_row(row, view.most_weight, &block.distance[first], &block.weight[first]);
  }
  block.all_free = is_all_free(block, view);
}

FusionView fusion_view(const DepthView& view, const SurfaceOptions& options, const SE3& T_c_v) {
  const PinholeCamera& c = view.camera;
  FusionView f{};
  f.R_c_v = T_c_v.rotation().cast<float>();
  f.fx = static_cast<float>(c.fx);
  f.fy = static_cast<float>(c.fy);
  f.cx = static_cast<float>(c.cx);
  f.cy = static_cast<float>(c.cy);
  f.width = static_cast<float>(c.width);
  f.height = static_cast<float>(c.height);
  f.stride = c.width;
  f.voxel = static_cast<float>(options.voxel);
  f.truncation = static_cast<float>(options.truncation * options.voxel);
  f.noise = static_cast<float>(options.depth_noise);
  f.most_weight = static_cast<float>(options.most_weight);
  return f;
}

}  // namespace

void SurfaceVolume::fuse(const DepthView& view, const SE3& T_c_v) {
  const FusionView f = fusion_view(view, options_, T_c_v);
  collect_blocks(view, T_c_v);
  add_blocks_to_carve(view, T_c_v);
  const std::vector<PixelReading> pixels = pixel_readings(f, view);
  const std::vector<std::int32_t> colours = packed_colours(view.colour);
  for (VoxelBlock* block : touched_) {
    update_block(f, pixels.data(), colours.empty() ? nullptr : colours.data(), T_c_v, *block);
    block->touched = false;
  }
}

/// Along the ray of a reading, from the truncation in front of it to that behind, in steps of half a block.
void SurfaceVolume::collect_blocks(const DepthView& view, const SE3& T_c_v) {
  const FusionView f = fusion_view(view, options_, T_c_v);
  const Eigen::Matrix3f R_v_c = f.R_c_v.transpose();
  const float blocks_a_metre = 1 / (f.voxel * kBlockEdge);
  const Eigen::Vector3f eye = T_c_v.inverse().translation().cast<float>() * blocks_a_metre;
  const auto most_depth = static_cast<float>(options_.most_depth > 0 ? options_.most_depth : 1e9);
  touched_.clear();
  // Readings beside each other meet the same blocks: only changes are looked up.
  std::vector<BlockPosition> last;
  for (int y = 0; y < view.depth.rows; y += kPixelStep) {
    const auto* row = view.depth.ptr<float>(y);
    for (int x = 0; x < view.depth.cols; x += kPixelStep) {
      const float z = row[x];
      if (z <= 0 || z > most_depth) continue;
      const Eigen::Vector3f ray_c((static_cast<float>(x) - f.cx) / f.fx,
                                  (static_cast<float>(y) - f.cy) / f.fy, 1);
      const Eigen::Vector3f ray = R_v_c * ray_c * blocks_a_metre;
      const float reach = truncation_at(f, z) / ray_c.norm();
      const int steps = std::max(2, static_cast<int>(std::ceil(4 * reach * blocks_a_metre)));
      if (last.size() <= static_cast<std::size_t>(steps)) last.resize(static_cast<std::size_t>(steps) + 1);
      for (int s = 0; s <= steps; ++s) {
        const float at = z + reach * (2 * static_cast<float>(s) / static_cast<float>(steps) - 1);
        const Eigen::Vector3f x_v = eye + at * ray;
        const BlockPosition block{static_cast<int>(std::floor(x_v.x())),
                                  static_cast<int>(std::floor(x_v.y())),
                                  static_cast<int>(std::floor(x_v.z()))};
        auto& before = last[static_cast<std::size_t>(s)];
        if (block == before && !touched_.empty()) continue;
        before = block;
        touch(block);
      }
    }
  }
}

/// Blocks in front of what is seen, as far as their centres tell.
void SurfaceVolume::add_blocks_to_carve(const DepthView& view, const SE3& T_c_v) {
  const double edge = kBlockEdge * options_.voxel;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    VoxelBlock& block = blocks_[b];
    if (block.touched || block.all_free) continue;
    const Vector3 centre(block.at.x + 0.5, block.at.y + 0.5, block.at.z + 0.5);
    const auto uv = view.camera.find_in_view(T_c_v * Vector3(centre * edge));
    if (!uv) continue;
    const double z = (T_c_v * Vector3(centre * edge)).z();
    const auto seen =
        view.nearest.at<float>(static_cast<int>(uv->y() + 0.5), static_cast<int>(uv->x() + 0.5));
    if (seen < z - edge) continue;
    block.touched = true;
    touched_.push_back(&block);
  }
}

}  // namespace twofold
