#pragma once

#ifdef __aarch64__
#include <arm_neon.h>
#endif

#include <cstdint>
#include <cstring>

namespace twofold {

using Bytes8 = std::uint8_t __attribute__((vector_size(8)));
using Shorts8 = std::int16_t __attribute__((vector_size(16)));
using Floats8 = float __attribute__((vector_size(32)));

// Compilers convert vectors in one go for AVX2, and number by number for NEON: there it is said how.

/// Eight pixels as numbers.
inline Floats8 to_floats(Bytes8 pixels) {
#ifdef __aarch64__
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

/// Eight numbers, each within the range of the integers, without what follows the point.
inline Shorts8 truncate(const Floats8& numbers) {
#ifdef __aarch64__
  const float32x4_t low = __builtin_shufflevector(numbers, numbers, 0, 1, 2, 3);
  const float32x4_t high = __builtin_shufflevector(numbers, numbers, 4, 5, 6, 7);
  return (Shorts8)vcombine_s16(vmovn_s32(vcvtq_s32_f32(low)), vmovn_s32(vcvtq_s32_f32(high)));
#else
  return __builtin_convertvector(numbers, Shorts8);
#endif
}

}  // namespace twofold
