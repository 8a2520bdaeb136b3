#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "geometry/se3.hpp"

namespace twofold::map_format {

static_assert(std::endian::native == std::endian::little,
              "the file is little-endian; other machines need a swap");

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

/// Collects the bytes of a section.
class ByteWriter {
 public:
  template <class T>
  void put(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    put_bytes({reinterpret_cast<const std::uint8_t*>(&value), sizeof(T)});
  }
  void put(const SE3& T) {
    const Eigen::Quaterniond& q = T.so3().quaternion();
    for (const double value : {q.x(), q.y(), q.z(), q.w()}) put(value);
    put_vector(T.translation());
  }
  template <class Vector>
  void put_vector(const Vector& v) {
    for (int i = 0; i < v.size(); ++i) put(v[i]);
  }
  void put_bytes(std::span<const std::uint8_t> bytes);
  void clear() { bytes_.clear(); }
  [[nodiscard]] std::span<const std::uint8_t> bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

/// Thrown by ByteReader; the map reader adds file and section.
struct FormatError {
  std::string what;
};

/// Takes values from a section, in order, never beyond its end.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <class T>
  T take() {
    static_assert(std::is_arithmetic_v<T>);
    T value;
    std::memcpy(&value, take_bytes(sizeof(T)).data(), sizeof(T));
    return value;
  }
  std::span<const std::uint8_t> take_bytes(std::size_t count) {
    if (count > bytes_.size()) throw FormatError{"ends in the middle of an entry"};
    const auto taken = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return taken;
  }
  double take_finite() {
    const auto value = take<double>();
    if (!std::isfinite(value)) throw FormatError{"holds a number that is not finite"};
    return value;
  }
  Vector3 take_vector3() {
    const double x = take_finite();
    const double y = take_finite();
    return {x, y, take_finite()};
  }
  SE3 take_pose() {
    const double x = take_finite();
    const double y = take_finite();
    const double z = take_finite();
    const Eigen::Quaterniond q(take_finite(), x, y, z);
    if (std::abs(q.norm() - 1) > 1e-6) throw FormatError{"holds a quaternion that is no rotation"};
    const SO3 R(q);
    return {R, take_vector3()};
  }
  /// Number of entries that follow, each at least `entry_bytes` long.
  std::size_t take_count(std::size_t entry_bytes) {
    const auto count = take<std::uint32_t>();
    if (count > bytes_.size() / entry_bytes) throw FormatError{"is too short for the entries it announces"};
    return count;
  }
  /// How many entries one stands for.
  std::uint32_t take_run() {
    const auto count = take<std::uint32_t>();
    if (count == 0) throw FormatError{"holds a run of nothing"};
    return count;
  }
  /// Flag or enumerator below `end`.
  std::uint8_t take_small(std::uint8_t end, const char* what) {
    const auto value = take<std::uint8_t>();
    if (value >= end) throw FormatError{std::string("holds an impossible ") + what};
    return value;
  }
  void expect_end() const {
    if (!bytes_.empty()) throw FormatError{"is longer than its entries"};
  }
  [[nodiscard]] bool at_end() const { return bytes_.empty(); }

 private:
  std::span<const std::uint8_t> bytes_;
};

}  // namespace twofold::map_format
