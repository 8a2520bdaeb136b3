#pragma once

#include <cstdint>
#include <cstring>

#include "surface/voxel_block.hpp"

namespace twofold {

// Eight numbers that one instruction works on, where the processor can: as an extension of the language that
// GCC and Clang share, since neither makes vectors of these short loops by itself. Comparisons give -1 or 0
// for each lane. Only for files of this room: whose ABI vectors follow where AVX is missing is not settled.
inline constexpr int kLanes = kBlockEdge;  // samples of a row, updated together
using Lane = float __attribute__((vector_size(kLanes * sizeof(float))));
using LaneIndex = std::int32_t __attribute__((vector_size(kLanes * sizeof(std::int32_t))));
using LaneShort = std::int16_t __attribute__((vector_size(kLanes * sizeof(std::int16_t))));
using LaneUnsignedShort = std::uint16_t __attribute__((vector_size(kLanes * sizeof(std::uint16_t))));

constexpr Lane kCount{0, 1, 2, 3, 4, 5, 6, 7};
constexpr Lane kZero{};
constexpr Lane kOne = kZero + 1;

inline Lane larger(const Lane& a, const Lane& b) {
  return a > b ? a : b;
}
inline Lane smaller(const Lane& a, const Lane& b) {
  return a < b ? a : b;
}
inline LaneIndex whole(const Lane& a) {
  return __builtin_convertvector(a, LaneIndex);
}
inline Lane real(const LaneIndex& a) {
  return __builtin_convertvector(a, Lane);
}

template <class Vector>
inline Vector load(const void* from) {
  Vector lanes;
  std::memcpy(&lanes, from, sizeof(Vector));
  return lanes;
}

inline bool any(const LaneIndex& lanes) {
  using Halves = std::uint64_t __attribute__((vector_size(sizeof(LaneIndex))));
  const auto h = reinterpret_cast<Halves>(lanes);
  return ((h[0] | h[1]) | (h[2] | h[3])) != 0;
}

inline float least(const Lane& lanes) {
  using Half = float __attribute__((vector_size(sizeof(Lane) / 2)));
  const Half low = __builtin_shufflevector(lanes, lanes, 0, 1, 2, 3);
  const Half high = __builtin_shufflevector(lanes, lanes, 4, 5, 6, 7);
  const Half four = low < high ? low : high;
  const float a = four[0] < four[1] ? four[0] : four[1];
  const float b = four[2] < four[3] ? four[2] : four[3];
  return a < b ? a : b;
}
inline float largest(const Lane& lanes) {
  return -least(-lanes);
}

}  // namespace twofold
