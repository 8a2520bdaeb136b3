#include "graph/map_section_reader.hpp"

#include <cstring>
#include <istream>

#include "base/checksum.hpp"
#include "graph/map_file.hpp"
#include "graph/map_format.hpp"

namespace twofold::map_format {

std::uint16_t SectionReader::read_header() {
  std::array<std::uint8_t, kHeaderBytes> header;
  if (left_ < header.size()) throw MalformedBytes("too short to be a map");
  read(header);
  if (std::memcmp(header.data(), kMagic.data(), kMagic.size()) != 0) throw MalformedBytes("not a map file");
  const std::uint16_t version = ByteReader(std::span(header).subspan(kMagic.size())).u16();
  if (version < 1 || version > kMapFormatVersion) {
    throw MalformedBytes("written in format version " + std::to_string(version) +
                         ", this program reads up to " + std::to_string(kMapFormatVersion));
  }
  return version;
}

void SectionReader::next(RawSection& section) {
  std::array<std::uint8_t, kSectionHeadBytes> head;
  if (left_ < head.size()) throw MalformedBytes("the file is cut short before its end section");
  read(head);
  ByteReader in(head);
  section.id = in.u32();
  const std::uint64_t length = in.u64();
  if (left_ < 4 || length > left_ - 4)
    throw MalformedBytes("reaches beyond the end of the file: it is cut short");
  section.bytes.resize(length);
  read(section.bytes);
  std::array<std::uint8_t, 4> tail;
  read(tail);
  if (ByteReader(tail).u32() != crc32_of(section.bytes, crc32_of(head)))
    throw MalformedBytes("checksum is wrong, the file is damaged");
}

void SectionReader::read(std::span<std::uint8_t> bytes) {
  in_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!in_) throw MalformedBytes("cannot be read");
  left_ -= bytes.size();
}

}  // namespace twofold::map_format
