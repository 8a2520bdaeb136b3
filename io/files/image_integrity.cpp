#include "io/files/image_integrity.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

#include <fmt/format.h>

#include "base/checksum.hpp"
#include "io/files/image_file.hpp"

namespace twofold {
namespace {

using Bytes = std::span<const unsigned char>;

constexpr std::array<unsigned char, 8> kPngSignature{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

std::uint32_t big_endian(Bytes bytes, std::size_t at, int count) {
  std::uint32_t value = 0;
  for (int i = 0; i < count; ++i) value = value << 8 | bytes[at + static_cast<std::size_t>(i)];
  return value;
}

std::string size_defect(std::uint32_t width, std::uint32_t height) {
  if (width > 0 && height > 0 && std::int64_t{width} * height <= kMaxImagePixels) return "";
  return fmt::format("has an impossible image size of {}x{}", width, height);
}

std::string png_defect(Bytes bytes) {
  constexpr std::size_t kOverhead = 12;  // length, type and CRC of a chunk
  for (std::size_t at = kPngSignature.size(); bytes.size() - at >= kOverhead;) {
    const std::uint32_t length = big_endian(bytes, at, 4);
    if (length > bytes.size() - at - kOverhead) return "is cut short";
    const unsigned char* type = &bytes[at + 4];
    if (crc32_of(bytes.subspan(at + 4, std::size_t{length} + 4)) != big_endian(bytes, at + 8 + length, 4))
      return "is damaged (check sum)";
    if (std::memcmp(type, "IHDR", 4) == 0 && length >= 8) {
      if (auto defect = size_defect(big_endian(bytes, at + 8, 4), big_endian(bytes, at + 12, 4));
          !defect.empty()) {
        return defect;
      }
    }
    if (std::memcmp(type, "IEND", 4) == 0) return "";
    at += kOverhead + length;
  }
  return "is cut short";
}

/// SOF0 to SOF15 without DHT (c4), JPG (c8) and DAC (cc), which share the range.
bool is_frame_header(unsigned char marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

std::string jpeg_defect(Bytes bytes) {
  constexpr unsigned char kStartOfScan = 0xda, kEndOfImage = 0xd9;
  bool has_size = false;
  std::size_t at = 2;
  while (true) {
    if (bytes.size() < at + 4) return "is cut short";
    if (bytes[at] != 0xff) return "is damaged (marker expected)";
    const unsigned char marker = bytes[at + 1];
    if (marker == 0xff) {  // fill byte
      ++at;
      continue;
    }
    if (marker == kStartOfScan) break;
    const std::uint32_t length = big_endian(bytes, at + 2, 2);
    if (length < 2 || bytes.size() - at - 2 < length) return "is cut short";
    if (is_frame_header(marker) && length >= 7) {
      if (auto defect = size_defect(big_endian(bytes, at + 7, 2), big_endian(bytes, at + 5, 2));
          !defect.empty()) {
        return defect;
      }
      has_size = true;
    }
    at += 2 + length;
  }
  if (!has_size) return "is damaged (no frame header)";
  // Some writers pad after the end marker, so look for the last one. In entropy-coded data 0xff is always
  // followed by 0 or a restart marker: a match cannot be image content.
  static constexpr std::array<unsigned char, 2> kEnd{0xff, kEndOfImage};
  const auto data = bytes.subspan(at);
  if (std::find_end(data.begin(), data.end(), kEnd.begin(), kEnd.end()) == data.end()) return "is cut short";
  return "";
}

}  // namespace

std::string image_defect(Bytes bytes) {
  if (bytes.empty()) return "is empty";
  if (bytes.size() >= kPngSignature.size() &&
      std::equal(kPngSignature.begin(), kPngSignature.end(), bytes.begin())) {
    return png_defect(bytes);
  }
  if (bytes.size() >= 2 && bytes[0] == 0xff && bytes[1] == 0xd8) return jpeg_defect(bytes);
  return "";
}

}  // namespace twofold
