#pragma once

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#include <cstdint>
#include <cstring>

namespace twofold {

inline constexpr int kByteRun = 32;

/// 32 pixels of a row side by side. Comparisons give 255 or 0.
#if defined(__aarch64__)

/// Two registers; a vector of 32 bytes is one that compilers take apart byte by byte where they compare.
struct ByteRun {
  uint8x16_t low, high;
};

inline ByteRun load_run(const std::uint8_t* p) {
  return {vld1q_u8(p), vld1q_u8(p + 16)};
}
/// The same value 32 times.
inline ByteRun run_of(std::uint8_t value) {
  return {vdupq_n_u8(value), vdupq_n_u8(value)};
}
inline ByteRun larger(ByteRun a, ByteRun b) {
  return {vmaxq_u8(a.low, b.low), vmaxq_u8(a.high, b.high)};
}
inline ByteRun smaller(ByteRun a, ByteRun b) {
  return {vminq_u8(a.low, b.low), vminq_u8(a.high, b.high)};
}
inline ByteRun operator-(ByteRun a, ByteRun b) {
  return {vsubq_u8(a.low, b.low), vsubq_u8(a.high, b.high)};
}
inline ByteRun operator&(ByteRun a, ByteRun b) {
  return {vandq_u8(a.low, b.low), vandq_u8(a.high, b.high)};
}
inline ByteRun above(ByteRun a, ByteRun b) {
  return {vcgtq_u8(a.low, b.low), vcgtq_u8(a.high, b.high)};
}
inline bool any_of(ByteRun marks) {
  return vmaxvq_u8(vorrq_u8(marks.low, marks.high)) != 0;
}
/// Bit k set where byte k of the marks is: each byte keeps one bit, and three rounds of adding neighbours put
/// eight bytes' bits into one.
inline std::uint32_t mask_of(ByteRun marks) {
  constexpr std::uint8_t kBits[16] = {1, 2, 4, 8, 16, 32, 64, 128, 1, 2, 4, 8, 16, 32, 64, 128};
  const uint8x16_t bits = vld1q_u8(kBits);
  uint8x16_t sums = vpaddq_u8(vandq_u8(marks.low, bits), vandq_u8(marks.high, bits));
  sums = vpaddq_u8(sums, sums);
  sums = vpaddq_u8(sums, sums);
  return vgetq_lane_u32(vreinterpretq_u32_u8(sums), 0);
}

#else

using ByteRun = std::uint8_t __attribute__((vector_size(kByteRun)));

inline ByteRun load_run(const std::uint8_t* p) {
  ByteRun bytes;
  std::memcpy(&bytes, p, sizeof bytes);
  return bytes;
}
/// The same value 32 times.
inline ByteRun run_of(std::uint8_t value) {
  return ByteRun{} + value;
}
inline ByteRun larger(ByteRun a, ByteRun b) {
  return a > b ? a : b;
}
inline ByteRun smaller(ByteRun a, ByteRun b) {
  return a < b ? a : b;
}
inline ByteRun above(ByteRun a, ByteRun b) {
  return static_cast<ByteRun>(a > b);
}
/// Bit k set where byte k of the marks is.
inline std::uint32_t mask_of(const ByteRun& marks) {
#ifdef __AVX2__
  __m256i bytes;
  std::memcpy(&bytes, &marks, sizeof bytes);
  return static_cast<std::uint32_t>(_mm256_movemask_epi8(bytes));
#else
  std::uint32_t mask = 0;
  for (int k = 0; k < kByteRun; ++k) mask |= (marks[k] != 0 ? 1U : 0U) << k;
  return mask;
#endif
}
inline bool any_of(const ByteRun& marks) {
  return mask_of(marks) != 0;
}

#endif

}  // namespace twofold
