#include "io/files/ply.hpp"

#include <bit>
#include <string>

#include <fmt/format.h>

#include "io/files/output_file.hpp"

namespace twofold {
namespace {

static_assert(std::endian::native == std::endian::little,
              "the numbers below are written as they stand in memory");

template <class T>
void append(const T& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(T));
}

}  // namespace

void write_ply(const std::filesystem::path& file, std::span<const PlyPoint> points) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment metres\nelement vertex {}\n"
      "property double x\nproperty double y\nproperty double z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float stddev\nend_header\n",
      points.size());
  constexpr std::size_t kPointBytes = 3 * sizeof(double) + 3 + sizeof(float);
  bytes.reserve(bytes.size() + points.size() * kPointBytes);
  for (const PlyPoint& point : points) {
    for (const double x : point.x_w) append(x, &bytes);
    for (const std::uint8_t c : point.rgb) append(c, &bytes);
    append(point.stddev, &bytes);
  }
  write_file(file, bytes);
}

}  // namespace twofold
