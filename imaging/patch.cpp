#include "imaging/patch.hpp"

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "geometry/inverse_depth.hpp"
#include "imaging/image_pyramid.hpp"
#include "imaging/level_pixels.hpp"
#include "imaging/pixel_row.hpp"

namespace twofold {
namespace {

constexpr int kBordered = Patch::kSize + 2;
constexpr int kHighestSearchLevel = 3;  // above it patches cover too much of the image to stay planar

constexpr int kAppearance = PointAppearance::kSize;
constexpr float kLast = kAppearance - 1.001F;  // last position with a pixel after it

constexpr std::size_t kLanes = 8;  // samples computed at once
using Ints8 = std::int32_t __attribute__((vector_size(kLanes * sizeof(std::int32_t))));

constexpr std::size_t kSamples = (kBordered * kBordered + kLanes - 1) / kLanes * kLanes;

/// Column and row of each pixel of a bordered patch, row by row; then some that nobody looks at.
struct SampleGrid {
  alignas(32) std::array<float, kSamples> column{};
  alignas(32) std::array<float, kSamples> row{};

  constexpr SampleGrid() {
    for (std::size_t i = 0; i < kSamples; ++i) {
      const std::size_t r = i / kBordered;
      column[i] = static_cast<float>(i % kBordered);
      row[i] = static_cast<float>(r);
    }
  }
};
constexpr SampleGrid kGrid;

/// The pixels before samples, and the weights of their right and lower neighbours.
struct SamplePlaces {
  alignas(32) std::array<std::int32_t, kSamples> pixel;
  alignas(32) std::array<float, kSamples> a;
  alignas(32) std::array<float, kSamples> b;
};

Floats8 clamped(Floats8 x) {
  const Floats8 at_most = x < kLast ? x : Floats8{} + kLast;
  return at_most > 0.0F ? at_most : Floats8{};
}

/// Samples at first + column * along_u + row * along_v. A strong warp reaches past what was kept: its rim is
/// repeated.
void place_samples(const Eigen::Vector2f& first, const Eigen::Vector2f& along_u,
                   const Eigen::Vector2f& along_v, SamplePlaces& places) {
  for (std::size_t i = 0; i < kSamples; i += kLanes) {
    const Floats8 column = load_floats(&kGrid.column[i]);
    const Floats8 row = load_floats(&kGrid.row[i]);
    const Floats8 u = clamped((first.x() + row * along_v.x()) + column * along_u.x());
    const Floats8 v = clamped((first.y() + row * along_v.y()) + column * along_u.y());
    const Ints8 u0 = __builtin_convertvector(u, Ints8);
    const Ints8 v0 = __builtin_convertvector(v, Ints8);
    const Floats8 a = u - __builtin_convertvector(u0, Floats8);
    const Floats8 b = v - __builtin_convertvector(v0, Floats8);
    const Ints8 pixel = v0 * kAppearance + u0;
    std::memcpy(&places.pixel[i], &pixel, sizeof pixel);
    std::memcpy(&places.a[i], &a, sizeof a);
    std::memcpy(&places.b[i], &b, sizeof b);
  }
}

/// Between the two pixels of each pair, whose first is the lower byte.
Floats8 between(const std::int32_t* pairs, const Floats8& weight) {
  Ints8 pair;
  std::memcpy(&pair, pairs, sizeof pair);
  const Floats8 left = __builtin_convertvector(pair & 255, Floats8);
  return left + weight * (__builtin_convertvector(pair >> 8, Floats8) - left);
}

/// Bilinear samples of an appearance.
void sample(const PointAppearance& appearance, const SamplePlaces& places,
            std::span<float, kSamples> samples) {
  alignas(32) std::array<std::int32_t, kSamples> upper;  // two pixels' bytes
  alignas(32) std::array<std::int32_t, kSamples> lower;
  for (std::size_t i = 0; i < kSamples; ++i) {
    const std::uint8_t* p = appearance.pixels.data() + places.pixel[i];
    std::uint16_t two = 0;
    std::memcpy(&two, p, sizeof two);
    upper[i] = two;
    std::memcpy(&two, p + kAppearance, sizeof two);
    lower[i] = two;
  }
  for (std::size_t i = 0; i < kSamples; i += kLanes) {
    const Floats8 a = load_floats(&places.a[i]);
    const Floats8 top = between(&upper[i], a);
    const Floats8 value = top + load_floats(&places.b[i]) * (between(&lower[i], a) - top);
    std::memcpy(&samples[i], &value, sizeof value);
  }
}

/// Fills the patch from its pixels and a border of one around them, rows `stride` apart.
template <class Pixel>
void fill_patch(const Pixel* bordered, std::ptrdiff_t stride, Patch& patch) {
  static_assert(Patch::kSize == 8);
  for (int r = 0; r < Patch::kSize; ++r) {
    const Pixel* p = bordered + (r + 1) * stride + 1;
    const Floats8 value = load_floats(p);
    const Floats8 gradient_u = 0.5F * (load_floats(p + 1) - load_floats(p - 1));
    const Floats8 gradient_v = 0.5F * (load_floats(p + stride) - load_floats(p - stride));
    const Shorts8 rounded = truncate(value + 0.5F);
    std::memcpy(patch.value + r * Patch::kSize, &value, sizeof value);
    std::memcpy(patch.gradient_u + r * Patch::kSize, &gradient_u, sizeof gradient_u);
    std::memcpy(patch.gradient_v + r * Patch::kSize, &gradient_v, sizeof gradient_v);
    std::memcpy(patch.rounded + r * Patch::kSize, &rounded, sizeof rounded);
  }
  const Eigen::Map<const Eigen::Array<float, Patch::kArea, 1>, Eigen::Aligned32> value(patch.value);
  const float mean = value.sum() / Patch::kArea;
  patch.deviation = std::sqrt((value - mean).square().sum() / Patch::kArea);
}

}  // namespace

std::optional<PatchWarp> predict_warp(const PinholeCamera& camera, const Vector3& psi, const SE3& T_c_a) {
  const Matrix3 R = T_c_a.rotation();
  const Vector3 x_c = R * from_inverse_depth(psi) + T_c_a.translation();
  if (!in_front_of_camera(x_c) || !(psi.z() > 0)) return std::nullopt;
  PatchWarp warp;
  // Moving by one pixel in the anchor moves the point by 1 / (f q) in its plane of constant depth.
  const Matrix23 J = camera.project_jacobian(x_c);
  warp.A_c_a.col(0) = J * R.col(0) / (camera.fx * psi.z());
  warp.A_c_a.col(1) = J * R.col(1) / (camera.fy * psi.z());
  warp.uv = camera.project(x_c);
  warp.depth = x_c.z();
  return warp;
}

std::optional<int> search_level(const Eigen::Matrix2d& A_c_a, int anchor_level) {
  const double determinant = A_c_a.determinant();
  if (!(determinant > 1e-4) || determinant > 1e4) return std::nullopt;
  const double octaves = 0.5 * std::log2(determinant) + anchor_level;
  const int level = std::clamp(static_cast<int>(std::lround(octaves)), 0, kHighestSearchLevel);
  if (std::abs(octaves - level) > 1.0) return std::nullopt;
  return level;
}

void warp_patch(const PointAppearance& appearance, const Eigen::Matrix2d& A_c_a, int level, Patch& patch) {
  const Eigen::Matrix2f A_a_c = (A_c_a * std::ldexp(1.0, appearance.level - level)).inverse().cast<float>();
  constexpr float kBefore = Patch::kCentre + 1;
  const Eigen::Vector2f first =
      Eigen::Vector2f::Constant(PointAppearance::kCentre) - kBefore * (A_a_c.col(0) + A_a_c.col(1));
  alignas(32) std::array<float, kSamples> bordered;
  SamplePlaces places;
  place_samples(first, A_a_c.col(0), A_a_c.col(1), places);
  sample(appearance, places, bordered);
  fill_patch(bordered.data(), kBordered, patch);
}

void scale_contrast(Patch& patch, float gain) {
  Eigen::Map<Eigen::Array<float, Patch::kArea, 1>, Eigen::Aligned32> value(patch.value);
  const float mean = value.sum() / Patch::kArea;
  value = gain * (value - mean) + std::min(gain * mean, 255.0F);
  for (int i = 0; i < Patch::kArea; ++i) {
    patch.gradient_u[i] *= gain;
    patch.gradient_v[i] *= gain;
    patch.rounded[i] = static_cast<std::int16_t>(std::lround(patch.value[i]));
  }
  patch.deviation *= gain;
}

bool cut_patch(const cv::Mat& level_image, int u, int v, Patch& patch) {
  const int u0 = u - Patch::kCentre - 1;
  const int v0 = v - Patch::kCentre - 1;
  if (u0 < 0 || v0 < 0 || u0 + kBordered > level_image.cols || v0 + kBordered > level_image.rows)
    return false;
  const auto stride = static_cast<std::ptrdiff_t>(level_image.step);
  fill_patch(level_image.ptr<std::uint8_t>(v0) + u0, stride, patch);
  return true;
}

bool cut_appearance(const cv::Mat& level_image, int u, int v, int level, PointAppearance& appearance) {
  const int u0 = u - PointAppearance::kCentre;
  const int v0 = v - PointAppearance::kCentre;
  if (u0 < 0 || v0 < 0 || u0 + PointAppearance::kSize > level_image.cols ||
      v0 + PointAppearance::kSize > level_image.rows) {
    return false;
  }
  for (int r = 0; r < PointAppearance::kSize; ++r) {
    const std::uint8_t* row = level_image.ptr<std::uint8_t>(v0 + r) + u0;
    std::copy_n(row, PointAppearance::kSize, appearance.pixels.data() + r * PointAppearance::kSize);
  }
  appearance.uv = {static_cast<float>(from_level(u, level)), static_cast<float>(from_level(v, level))};
  appearance.level = static_cast<std::uint8_t>(level);
  return true;
}

int zero_mean_ssd(const Patch& patch, const cv::Mat& image, int u, int v) {
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  const std::uint8_t* row = image.data + (v - Patch::kCentre) * stride + (u - Patch::kCentre);
  const std::int16_t* t = patch.rounded;
  static_assert(Patch::kSize == 8);
#if defined(__AVX2__)
  __m256i sums = _mm256_setzero_si256();     // 16 sums of 4 differences
  __m256i squares = _mm256_setzero_si256();  // 8 sums of 8 squares
  for (int r = 0; r < Patch::kSize; r += 2, row += 2 * stride, t += 2 * Patch::kSize) {
    const __m128i upper = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(row));
    const __m128i lower = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(row + stride));
    const __m256i pixels = _mm256_cvtepu8_epi16(_mm_unpacklo_epi64(upper, lower));
    const __m256i d = _mm256_sub_epi16(pixels, _mm256_load_si256(reinterpret_cast<const __m256i*>(t)));
    sums = _mm256_add_epi16(sums, d);
    squares = _mm256_add_epi32(squares, _mm256_madd_epi16(d, d));
  }
  const __m256i wide_sums = _mm256_madd_epi16(sums, _mm256_set1_epi16(1));
  __m256i both = _mm256_hadd_epi32(wide_sums, squares);
  both = _mm256_hadd_epi32(both, both);
  const __m128i halves = _mm_add_epi32(_mm256_castsi256_si128(both), _mm256_extracti128_si256(both, 1));
  const int sum = _mm_cvtsi128_si32(halves);
  const int sum2 = _mm_extract_epi32(halves, 1);
#elif defined(__aarch64__)
  int16x8_t sums = vdupq_n_s16(0);     // of the differences, by columns
  int32x4_t squares = vdupq_n_s32(0);  // of columns c and c + 4
  for (int r = 0; r < Patch::kSize; ++r, row += stride, t += Patch::kSize) {
    const int16x8_t d = vsubq_s16(vreinterpretq_s16_u16(vmovl_u8(vld1_u8(row))), vld1q_s16(t));
    sums = vaddq_s16(sums, d);
    squares = vmlal_high_s16(vmlal_s16(squares, vget_low_s16(d), vget_low_s16(d)), d, d);
  }
  const int sum = vaddlvq_s16(sums);
  const int sum2 = vaddvq_s32(squares);
#else
  int sum = 0;
  int sum2 = 0;
  for (int r = 0; r < Patch::kSize; ++r, row += stride, t += Patch::kSize) {
    for (int c = 0; c < Patch::kSize; ++c) {
      const int d = row[c] - t[c];
      sum += d;
      sum2 += d * d;
    }
  }
#endif
  return sum2 - sum * sum / Patch::kArea;
}

}  // namespace twofold
