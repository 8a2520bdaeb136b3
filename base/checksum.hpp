#pragma once

#include <cstdint>
#include <span>

namespace twofold {

/// CRC-32 of IEEE 802.3, as in PNG, zip and MCAP.
/// @param before  checksum of the bytes that these follow; 0 for none
[[nodiscard]] std::uint32_t crc32_of(std::span<const std::uint8_t> bytes, std::uint32_t before = 0);

}  // namespace twofold
