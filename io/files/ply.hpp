#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "geometry/types.hpp"

namespace twofold {

struct PlyPoint {
  Vector3 x_w;  ///< [m], or of an arbitrary unit, as stddev
  std::array<std::uint8_t, 3> rgb = {255, 255, 255};
  float stddev = 0;  ///< of the position, along its worst axis [m]; 0 = unknown
  /// Line, from 0, of the keyframe that it was first seen in, or of the one before, if that is gone, in
  /// keyframes_loaded.txt, if there is one, and keyframes.txt after it; kUnknown if there is none.
  std::uint32_t first_keyframe = kUnknown;
  std::uint32_t observers = 0;  ///< keyframes that see it; 0: unknown

  static constexpr std::uint32_t kUnknown = 0xffffffffU;
};

/// Of positions: metres, or a unit of their own, as one camera has.
enum class LengthUnit { kMetre, kArbitrary };

/// Writes a binary little-endian PLY with vertex properties x y z (double), red green blue, stddev (float),
/// first_keyframe and observers (uint). A comment says the unit.
/// Throws IoError when the file cannot be written in full.
void write_ply(const std::filesystem::path& file, std::span<const PlyPoint> points,
               LengthUnit unit = LengthUnit::kMetre);

/// Reads what write_ply writes, or wrote before there were the last two properties, and no other form. Throws
/// IoError.
[[nodiscard]] std::vector<PlyPoint> read_ply(const std::filesystem::path& file);

}  // namespace twofold
