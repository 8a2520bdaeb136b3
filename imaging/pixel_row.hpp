#pragma once

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#include <cstdint>
#include <cstring>

namespace twofold {

using Bytes8 = std::uint8_t __attribute__((vector_size(8)));
using Shorts8 = std::int16_t __attribute__((vector_size(16)));
using Floats8 = float __attribute__((vector_size(32)));

// Compilers convert bytes to numbers and back one by one (g++ 12 even for AVX2): it is said how.

/// Eight pixels as numbers.
inline Floats8 to_floats(Bytes8 pixels) {
#if defined(__AVX2__)
  std::int64_t bytes;
  std::memcpy(&bytes, &pixels, sizeof bytes);
  return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(bytes)));
#elif defined(__aarch64__)
  const uint16x8_t wide = vmovl_u8((uint8x8_t)pixels);
  const float32x4_t low = vcvtq_f32_u32(vmovl_u16(vget_low_u16(wide)));
  const float32x4_t high = vcvtq_f32_u32(vmovl_high_u16(wide));
  return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
#else
  return __builtin_convertvector(pixels, Floats8);
#endif
}
inline Floats8 load_floats(const std::uint8_t* first) {
  Bytes8 pixels;
  std::memcpy(&pixels, first, sizeof pixels);
  return to_floats(pixels);
}
inline Floats8 load_floats(const float* first) {
  Floats8 numbers;
  std::memcpy(&numbers, first, sizeof numbers);
  return numbers;
}

/// The sum of each of eight rows of eight numbers. Halves are added, then quarters: as long as three sums of
/// one row.
inline Floats8 sums_of_rows(const Floats8 (&rows)[8]) {
  const auto halves = [](const Floats8& a, const Floats8& b) {
    return __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11) +
           __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
  };
  const auto quarters = [](const Floats8& a, const Floats8& b) {
    return __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13) +
           __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
  };
  const Floats8 a = quarters(halves(rows[0], rows[4]), halves(rows[1], rows[5]));
  const Floats8 b = quarters(halves(rows[2], rows[6]), halves(rows[3], rows[7]));
  return __builtin_shufflevector(a, b, 0, 2, 8, 10, 4, 6, 12, 14) +
         __builtin_shufflevector(a, b, 1, 3, 9, 11, 5, 7, 13, 15);
}

/// Eight numbers, each within the range of the integers, without what follows the point.
inline Shorts8 truncate(const Floats8& numbers) {
#if defined(__AVX2__)
  const __m256i wide = _mm256_cvttps_epi32(numbers);
  return (Shorts8)_mm_packs_epi32(_mm256_castsi256_si128(wide), _mm256_extracti128_si256(wide, 1));
#elif defined(__aarch64__)
  const float32x4_t low = __builtin_shufflevector(numbers, numbers, 0, 1, 2, 3);
  const float32x4_t high = __builtin_shufflevector(numbers, numbers, 4, 5, 6, 7);
  return (Shorts8)vcombine_s16(vmovn_s32(vcvtq_s32_f32(low)), vmovn_s32(vcvtq_s32_f32(high)));
#else
  return __builtin_convertvector(numbers, Shorts8);
#endif
}

}  // namespace twofold
