#include "imaging/patch.hpp"

#ifdef __AVX2__
#include <immintrin.h>
#endif

#include <algorithm>
#include <cmath>
#include <cstring>

#include "geometry/inverse_depth.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {
namespace {

constexpr int kBordered = Patch::kSize + 2;
constexpr int kHighestSearchLevel = 3;  // above it patches cover too much of the image to stay planar

constexpr int kAppearance = PointAppearance::kSize;
constexpr float kLast = kAppearance - 1.001F;  // last position with a pixel after it

float sample(const std::uint8_t* pixels, float u, float v) {
  const int u0 = static_cast<int>(u);
  const int v0 = static_cast<int>(v);
  const float a = u - static_cast<float>(u0);
  const float b = v - static_cast<float>(v0);
  const std::uint8_t* p = pixels + v0 * kAppearance + u0;
  const auto p00 = static_cast<float>(p[0]);
  const auto p10 = static_cast<float>(p[kAppearance]);
  const float top = p00 + a * (static_cast<float>(p[1]) - p00);
  const float bottom = p10 + a * (static_cast<float>(p[kAppearance + 1]) - p10);
  return top + b * (bottom - top);
}

/// Fills the patch from its pixels and a border of one around them, rows `stride` apart.
template <class Pixel>
void fill_patch(const Pixel* bordered, std::ptrdiff_t stride, Patch& patch) {
  using Row = float __attribute__((vector_size(Patch::kSize * sizeof(float))));
  using Rounded = std::int16_t __attribute__((vector_size(Patch::kSize * sizeof(std::int16_t))));
  const auto row_at = [](const Pixel* first) {
    Pixel __attribute__((vector_size(Patch::kSize * sizeof(Pixel)))) pixels;
    std::memcpy(&pixels, first, sizeof pixels);
    return __builtin_convertvector(pixels, Row);
  };
  for (int r = 0; r < Patch::kSize; ++r) {
    const Pixel* p = bordered + (r + 1) * stride + 1;
    const Row value = row_at(p);
    const Row gradient_u = 0.5F * (row_at(p + 1) - row_at(p - 1));
    const Row gradient_v = 0.5F * (row_at(p + stride) - row_at(p - stride));
    const Rounded rounded = __builtin_convertvector(value + 0.5F, Rounded);
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
  float bordered[kBordered * kBordered];
  for (int r = 0; r < kBordered; ++r) {
    const Eigen::Vector2f row = first + static_cast<float>(r) * A_a_c.col(1);
    for (int c = 0; c < kBordered; ++c) {
      const float u = row.x() + static_cast<float>(c) * A_a_c(0, 0);
      const float v = row.y() + static_cast<float>(c) * A_a_c(1, 0);
      // A strong warp reaches past what was kept: its rim is repeated.
      bordered[r * kBordered + c] =
          sample(appearance.pixels.data(), std::clamp(u, 0.0F, kLast), std::clamp(v, 0.0F, kLast));
    }
  }
  fill_patch(bordered, kBordered, patch);
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
  const double scale = std::ldexp(1.0, level);
  appearance.uv = {static_cast<float>((u + 0.5) * scale - 0.5), static_cast<float>((v + 0.5) * scale - 0.5)};
  appearance.level = static_cast<std::uint8_t>(level);
  return true;
}

int zero_mean_ssd(const Patch& patch, const cv::Mat& image, int u, int v) {
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  const std::uint8_t* row = image.data + (v - Patch::kCentre) * stride + (u - Patch::kCentre);
  const std::int16_t* t = patch.rounded;
#ifdef __AVX2__
  static_assert(Patch::kSize == 8);
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
