// libFuzzer target for the map parser: whatever the bytes, it gives a map whose cross references hold, or a
// MapFileError. A section's checksum would stop nearly every mutation: it is put right first.

#include <zlib.h>
#include <cstring>
#include <sstream>

#include "graph/map_file.hpp"

namespace {

void repair_checksums(std::string& bytes) {
  std::size_t at = 8;
  while (at + 16 <= bytes.size()) {
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data() + at + 4, 8);
    if (length > bytes.size() - at - 16) return;
    const auto end = at + 12 + static_cast<std::size_t>(length);
    const auto crc =
        static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data() + at), end - at));
    std::memcpy(bytes.data() + end, &crc, 4);
    at = end + 4;
  }
}

void parse(const std::string& bytes) {
  std::istringstream in(bytes);
  try {
    const twofold::SavedMap map = twofold::read_map(in, bytes.size(), "fuzz");
    for (std::uint32_t p = 0; p < map.graph.point_count(); ++p) {
      if (!map.graph.point(twofold::PointId{p}).culled()) (void)map.graph.position(twofold::PointId{p});
    }
  } catch (const twofold::MapFileError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string bytes(reinterpret_cast<const char*>(data), size);
  parse(bytes);
  repair_checksums(bytes);
  parse(bytes);
  return 0;
}
