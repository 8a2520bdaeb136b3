#include "graph/map_section_reader.hpp"

#include <zlib.h>
#include <istream>

#include "graph/map_file.hpp"
#include "graph/map_format.hpp"

namespace twofold::map_format {

std::uint16_t SectionReader::read_header() {
  std::array<std::uint8_t, kHeaderBytes> header;
  if (left_ < header.size()) throw FormatError{"too short to be a map"};
  read(header);
  if (std::memcmp(header.data(), kMagic.data(), kMagic.size()) != 0) throw FormatError{"not a map file"};
  std::uint16_t version = 0;
  std::memcpy(&version, header.data() + kMagic.size(), sizeof version);
  if (version < 1 || version > kMapFormatVersion) {
    throw FormatError{"written in format version " + std::to_string(version) + ", this program reads up to " +
                      std::to_string(kMapFormatVersion)};
  }
  return version;
}

void SectionReader::next(RawSection& section) {
  std::array<std::uint8_t, kSectionHeadBytes> head;
  if (left_ < head.size()) throw FormatError{"the file is cut short before its end section"};
  read(head);
  std::uint64_t length = 0;
  std::memcpy(&section.id, head.data(), 4);
  std::memcpy(&length, head.data() + 4, 8);
  if (left_ < 4 || length > left_ - 4)
    throw FormatError{"reaches beyond the end of the file: it is cut short"};
  section.bytes.resize(length);
  read(section.bytes);
  std::array<std::uint8_t, 4> tail;
  read(tail);
  uLong crc = crc32(0, head.data(), static_cast<uInt>(head.size()));
  if (!section.bytes.empty()) crc = crc32_z(crc, section.bytes.data(), section.bytes.size());
  std::uint32_t written = 0;
  std::memcpy(&written, tail.data(), 4);
  if (written != static_cast<std::uint32_t>(crc)) throw FormatError{"checksum is wrong, the file is damaged"};
}

void SectionReader::read(std::span<std::uint8_t> bytes) {
  in_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!in_) throw FormatError{"cannot be read"};
  left_ -= bytes.size();
}

}  // namespace twofold::map_format
