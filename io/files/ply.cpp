#include "io/files/ply.hpp"

#include <bit>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"

namespace twofold {
namespace {

static_assert(std::endian::native == std::endian::little,
              "the numbers below are written as they stand in memory");

template <class T>
void append(const T& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(T));
}

template <class T>
void take(const char*& bytes, T& value) {
  std::memcpy(&value, bytes, sizeof(T));
  bytes += sizeof(T);
}

constexpr std::size_t kShortBytes =
    3 * sizeof(double) + 3 + sizeof(float);  // without the last two properties
constexpr std::size_t kPointBytes = kShortBytes + 2 * sizeof(std::uint32_t);

std::string header(std::size_t points, bool is_short, LengthUnit unit) {
  return fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment {}\nelement vertex {}\n"
      "property double x\nproperty double y\nproperty double z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float stddev\n{}end_header\n",
      unit == LengthUnit::kMetre ? "metres" : "an arbitrary unit of length", points,
      is_short ? "" : "property uint first_keyframe\nproperty uint observers\n");
}

}  // namespace

void write_ply(const std::filesystem::path& file, std::span<const PlyPoint> points, LengthUnit unit) {
  std::string bytes = header(points.size(), false, unit);
  bytes.reserve(bytes.size() + points.size() * kPointBytes);
  for (const PlyPoint& point : points) {
    for (const double x : point.x_w) append(x, &bytes);
    for (const std::uint8_t c : point.rgb) append(c, &bytes);
    append(point.stddev, &bytes);
    append(point.first_keyframe, &bytes);
    append(point.observers, &bytes);
  }
  write_file(file, bytes);
}

std::vector<PlyPoint> read_ply(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw IoError(file.string(), "cannot be opened");
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  // The file's size tells the number of points, and so what its header must be.
  const std::size_t end = bytes.find("end_header\n");
  const std::size_t begin = end == std::string::npos ? bytes.size() : end + std::strlen("end_header\n");
  const bool is_short = std::string_view(bytes).substr(0, begin).find("first_keyframe") == std::string::npos;
  const std::size_t point_bytes = is_short ? kShortBytes : kPointBytes;
  const std::size_t count = (bytes.size() - begin) / point_bytes;
  const auto is_header = [&](LengthUnit unit) {
    return bytes.compare(0, begin, header(count, is_short, unit)) == 0;
  };
  if (bytes.size() != begin + count * point_bytes ||
      !(is_header(LengthUnit::kMetre) || is_header(LengthUnit::kArbitrary)))
    throw IoError(file.string(), "is no PLY file of this program, or damaged");
  std::vector<PlyPoint> points(count);
  const char* at = bytes.data() + begin;
  for (PlyPoint& point : points) {
    for (double& x : point.x_w) take(at, x);
    for (std::uint8_t& c : point.rgb) take(at, c);
    take(at, point.stddev);
    if (is_short) continue;
    take(at, point.first_keyframe);
    take(at, point.observers);
  }
  return points;
}

}  // namespace twofold
