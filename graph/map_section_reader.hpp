#pragma once

#include <cstdint>
#include <iosfwd>
#include <span>
#include <vector>

namespace twofold::map_format {

struct RawSection {
  std::uint32_t id = 0;
  std::vector<std::uint8_t> bytes;
};

/// Reads a map file's sections from a stream whose size is known, so that a length that is too large is found
/// before memory is asked for. All functions throw MalformedBytes.
class SectionReader {
 public:
  SectionReader(std::istream& in, std::uint64_t size) : in_(in), left_(size) {}

  /// What a map file starts with; returns its format version.
  std::uint16_t read_header();
  /// The next section, whose checksum is right.
  void next(RawSection& section);

  /// Bytes not read yet.
  [[nodiscard]] std::uint64_t left() const { return left_; }

 private:
  void read(std::span<std::uint8_t> bytes);

  std::istream& in_;
  std::uint64_t left_;
};

}  // namespace twofold::map_format
