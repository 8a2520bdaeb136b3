#pragma once

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#include <cmath>
#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace twofold {

/// Sum of the outer products of the gradients over 8x8 pixels. Central differences are not halved, so that it
/// is four times the structure tensor (Shi and Tomasi, 1994), and whole.
struct StructureTensor {
  int uu, uv, vv;

  /// Its smaller eigenvalue.
  [[nodiscard]] double smaller_eigenvalue() const {
    const double a = uu, b = uv, c = vv;
    return 0.5 * (a + c - std::sqrt((a - c) * (a - c) + 4 * b * b));
  }
  /// smaller_eigenvalue() > bound, without the square root: the tensor less the bound is positive definite.
  [[nodiscard]] bool exceeds(double bound) const {
    const double b = uv;
    return uu > bound && vv > bound && (uu - bound) * (vv - bound) > b * b;
  }
};

/// Over the pixels [u - 4, u + 4) x [v - 4, v + 4); they and a border of one lie in the image (8 bit).
inline StructureTensor structure_tensor(const cv::Mat& image, int u, int v) {
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  const std::uint8_t* p = image.data + (v - 4) * stride + u - 4;
#if defined(__AVX2__)
  const auto eight = [](const std::uint8_t* at) {
    return _mm_cvtepu8_epi16(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(at)));
  };
  __m128i sums_uu = _mm_setzero_si128();
  __m128i sums_uv = _mm_setzero_si128();
  __m128i sums_vv = _mm_setzero_si128();
  for (int r = 0; r < 8; ++r, p += stride) {
    const __m128i gu = _mm_sub_epi16(eight(p + 1), eight(p - 1));
    const __m128i gv = _mm_sub_epi16(eight(p + stride), eight(p - stride));
    sums_uu = _mm_add_epi32(sums_uu, _mm_madd_epi16(gu, gu));
    sums_uv = _mm_add_epi32(sums_uv, _mm_madd_epi16(gu, gv));
    sums_vv = _mm_add_epi32(sums_vv, _mm_madd_epi16(gv, gv));
  }
  const __m128i pairs = _mm_hadd_epi32(sums_uu, sums_uv);
  const __m128i total = _mm_hadd_epi32(pairs, _mm_hadd_epi32(sums_vv, sums_vv));
  return {_mm_extract_epi32(total, 0), _mm_extract_epi32(total, 1), _mm_extract_epi32(total, 2)};
#elif defined(__aarch64__)
  const auto difference = [](const std::uint8_t* a, const std::uint8_t* b) {
    return vreinterpretq_s16_u16(vsubl_u8(vld1_u8(a), vld1_u8(b)));
  };
  const auto add_products = [](int32x4_t sums, int16x8_t a, int16x8_t b) {
    return vmlal_high_s16(vmlal_s16(sums, vget_low_s16(a), vget_low_s16(b)), a, b);
  };
  int32x4_t sums_uu = vdupq_n_s32(0), sums_uv = sums_uu, sums_vv = sums_uu;
  for (int r = 0; r < 8; ++r, p += stride) {
    const int16x8_t gu = difference(p + 1, p - 1);
    const int16x8_t gv = difference(p + stride, p - stride);
    sums_uu = add_products(sums_uu, gu, gu);
    sums_uv = add_products(sums_uv, gu, gv);
    sums_vv = add_products(sums_vv, gv, gv);
  }
  return {vaddvq_s32(sums_uu), vaddvq_s32(sums_uv), vaddvq_s32(sums_vv)};
#else
  StructureTensor sum{};
  for (int r = 0; r < 8; ++r, p += stride) {
    for (int c = 0; c < 8; ++c) {
      const int gu = p[c + 1] - p[c - 1];
      const int gv = p[c + stride] - p[c - stride];
      sum.uu += gu * gu;
      sum.uv += gu * gv;
      sum.vv += gv * gv;
    }
  }
  return sum;
#endif
}

}  // namespace twofold
