#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "base/bytes.hpp"
#include "geometry/se3.hpp"

namespace twofold::map_format {

inline constexpr std::array<char, 5> kMagic{'T', 'F', 'M', 'A', 'P'};
inline constexpr std::size_t kHeaderBytes = 8;
inline constexpr std::size_t kSectionHeadBytes = 12;
inline constexpr std::uint32_t kSkippable = 0x80000000U;

enum class Section : std::uint32_t { kEnd = 0, kHead = 1, kKeyframes = 2, kPoints = 3, kPlaces = 4 };
[[nodiscard]] constexpr const char* name_of(Section section) {
  switch (section) {
    case Section::kEnd:
      return "end";
    case Section::kHead:
      return "head";
    case Section::kKeyframes:
      return "keyframes";
    case Section::kPoints:
      return "points";
    case Section::kPlaces:
      return "places";
  }
  return "unknown";
}

/// What a keyframe's entry holds, its first byte. In version 1 there is no such byte, and all of it is there.
enum class EntryKind : std::uint8_t {
  kForgotten,  ///< culled: how many such keyframes follow each other; in version 2 nothing: it is one
  kCulled,     ///< replacement
  kKeyframe,   ///< all but a replacement
};

// Slices of the map a section holds at most: what reader and writer keep in memory beside the map.
inline constexpr std::uint32_t kKeyframesPerSection = 1024;
inline constexpr std::uint32_t kPointsPerSection = 16384;
inline constexpr std::uint32_t kPlacesPerSection = 256;
// Of a map, culled ones included: what a camera makes in some months.
inline constexpr std::uint32_t kMaxKeyframes = 1U << 24;
inline constexpr std::uint32_t kMaxPoints = 1U << 28;
inline constexpr std::uint8_t kLevels = 16;  // of a pyramid: a file's numbers are below this

/// Collects the entries of a section.
class EntryWriter : public ByteWriter {
 public:
  using ByteWriter::put;
  void put(const SE3& T) {
    const Eigen::Quaterniond& q = T.so3().quaternion();
    for (const double value : {q.x(), q.y(), q.z(), q.w()}) put(value);
    put_vector(T.translation());
  }
  template <class Vector>
  void put_vector(const Vector& v) {
    for (int i = 0; i < v.size(); ++i) put(v[i]);
  }
};

/// Takes entries from a section, in order. Throws MalformedBytes, to which the map reader adds file and
/// section.
class EntryReader : public ByteReader {
 public:
  using ByteReader::ByteReader;

  double finite() {
    const auto value = number<double>();
    if (!std::isfinite(value)) throw MalformedBytes("holds a number that is not finite");
    return value;
  }
  Vector3 vector3() {
    const double x = finite();
    const double y = finite();
    return {x, y, finite()};
  }
  SE3 pose() {
    const double x = finite();
    const double y = finite();
    const double z = finite();
    const Eigen::Quaterniond q(finite(), x, y, z);
    if (std::abs(q.norm() - 1) > 1e-6) throw MalformedBytes("holds a quaternion that is no rotation");
    const SO3 R(q);
    return {R, vector3()};
  }
  /// Number of entries that follow, each at least `entry_bytes` long.
  std::size_t count(std::size_t entry_bytes) {
    const std::uint32_t count = u32();
    if (count > remaining() / entry_bytes) throw MalformedBytes("is too short for the entries it announces");
    return count;
  }
  /// How many entries one stands for.
  std::uint32_t run() {
    const std::uint32_t count = u32();
    if (count == 0) throw MalformedBytes("holds a run of nothing");
    return count;
  }
  /// Flag or enumerator below `end`.
  std::uint8_t small(std::uint8_t end, const char* what) {
    const std::uint8_t value = u8();
    if (value >= end) throw MalformedBytes(std::string("holds an impossible ") + what);
    return value;
  }
  void expect_end() const {
    if (!at_end()) throw MalformedBytes("is longer than its entries");
  }
};

}  // namespace twofold::map_format
