#include "graph/map_format.hpp"

namespace twofold::map_format {

void ByteWriter::put_bytes(std::span<const std::uint8_t> bytes) {
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
}

}  // namespace twofold::map_format
