#pragma once

#include <cstdint>
#include <cstring>

#ifdef __AVX2__
#include <immintrin.h>
#endif

#include "surface/voxel_block.hpp"

namespace twofold {

// Eight numbers that one instruction works on, where the processor can: as an extension of the language that
// GCC and Clang share, since neither makes vectors of these short loops by itself. Comparisons give -1 or 0
// for each lane. Only for files of this room: whose ABI vectors follow where AVX is missing is not settled.
inline constexpr int kLanes = kBlockEdge;  // samples of a row, updated together
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));
using LaneIndex = std::int32_t __attribute__((vector_size(kLanes * sizeof(std::int32_t))));
using LaneShort = std::int16_t __attribute__((vector_size(kLanes * sizeof(std::int16_t))));
using LaneUnsignedShort = std::uint16_t __attribute__((vector_size(kLanes * sizeof(std::uint16_t))));

constexpr Lanes kCount{0, 1, 2, 3, 4, 5, 6, 7};
constexpr Lanes kZero{};
constexpr Lanes kOne = kZero + 1;

// What follows says the same twice, since GCC 12 takes two to four instructions for what AVX2 has one for.

inline Lanes larger(const Lanes& a, const Lanes& b) {
#ifdef __AVX2__
  return _mm256_max_ps(a, b);
#else
  return a > b ? a : b;
#endif
}
inline Lanes smaller(const Lanes& a, const Lanes& b) {
#ifdef __AVX2__
  return _mm256_min_ps(a, b);
#else
  return a < b ? a : b;
#endif
}
inline LaneIndex smaller(const LaneIndex& a, const LaneIndex& b) {
#ifdef __AVX2__
  return reinterpret_cast<LaneIndex>(
      _mm256_min_epi32(reinterpret_cast<__m256i>(a), reinterpret_cast<__m256i>(b)));
#else
  return a < b ? a : b;
#endif
}
inline LaneIndex wide(const LaneShort& a) {
#ifdef __AVX2__
  return reinterpret_cast<LaneIndex>(_mm256_cvtepi16_epi32(reinterpret_cast<__m128i>(a)));
#else
  return __builtin_convertvector(a, LaneIndex);
#endif
}
inline LaneIndex wide(const LaneUnsignedShort& a) {
#ifdef __AVX2__
  return reinterpret_cast<LaneIndex>(_mm256_cvtepu16_epi32(reinterpret_cast<__m128i>(a)));
#else
  return __builtin_convertvector(a, LaneIndex);
#endif
}
/// Of numbers that fit.
inline LaneShort narrow(const LaneIndex& a) {
#ifdef __AVX2__
  const auto all = reinterpret_cast<__m256i>(a);
  return reinterpret_cast<LaneShort>(
      _mm_packs_epi32(_mm256_castsi256_si128(all), _mm256_extracti128_si256(all, 1)));
#else
  return __builtin_convertvector(a, LaneShort);
#endif
}
/// Likewise.
inline LaneUnsignedShort narrow_unsigned(const LaneIndex& a) {
#ifdef __AVX2__
  const auto all = reinterpret_cast<__m256i>(a);
  return reinterpret_cast<LaneUnsignedShort>(
      _mm_packus_epi32(_mm256_castsi256_si128(all), _mm256_extracti128_si256(all, 1)));
#else
  return __builtin_convertvector(a, LaneUnsignedShort);
#endif
}
inline bool any(const LaneIndex& lanes) {
#ifdef __AVX2__
  const auto all = reinterpret_cast<__m256i>(lanes);
  return _mm256_testz_si256(all, all) == 0;
#else
  using Halves = std::uint64_t __attribute__((vector_size(sizeof(LaneIndex))));
  const auto h = reinterpret_cast<Halves>(lanes);
  return ((h[0] | h[1]) | (h[2] | h[3])) != 0;
#endif
}
inline bool any(const LaneShort& lanes) {
  const auto halves = reinterpret_cast<std::uint64_t __attribute__((vector_size(sizeof(LaneShort))))>(lanes);
  return (halves[0] | halves[1]) != 0;
}

inline LaneIndex whole(const Lanes& a) {
  return __builtin_convertvector(a, LaneIndex);
}
inline Lanes real(const LaneIndex& a) {
  return __builtin_convertvector(a, Lanes);
}
inline Lanes real(const LaneShort& a) {
  return real(wide(a));
}
inline Lanes real(const LaneUnsignedShort& a) {
  return real(wide(a));
}

template <class Vector>
inline Vector load(const void* from) {
  Vector lanes;
  std::memcpy(&lanes, from, sizeof(Vector));
  return lanes;
}

inline float least(const Lanes& lanes) {
  using Half = float __attribute__((vector_size(sizeof(Lanes) / 2)));
  const Half low = __builtin_shufflevector(lanes, lanes, 0, 1, 2, 3);
  const Half high = __builtin_shufflevector(lanes, lanes, 4, 5, 6, 7);
  const Half four = low < high ? low : high;
  const float a = four[0] < four[1] ? four[0] : four[1];
  const float b = four[2] < four[3] ? four[2] : four[3];
  return a < b ? a : b;
}
inline float largest(const Lanes& lanes) {
  return -least(-lanes);
}

}  // namespace twofold
