#pragma once

#include <cstdint>
#include <limits>

#include "base/bytes.hpp"

namespace twofold {

/// Appends LEB128, low seven bits first.
inline void put_varint(ByteWriter& bytes, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) bytes.put(static_cast<std::uint8_t>(value | 0x80));
  bytes.put(static_cast<std::uint8_t>(value));
}

/// What put_varint wrote. Throws MalformedBytes at the end, or when it does not fit.
[[nodiscard]] inline std::uint64_t take_varint(ByteReader& in) {
  std::uint64_t value = 0;
  for (unsigned shift = 0; shift < 64; shift += 7) {
    const std::uint8_t next = in.u8();
    if (shift == 63 && next > 1) break;
    value |= static_cast<std::uint64_t>(next & 0x7F) << shift;
    if ((next & 0x80) == 0) return value;
  }
  throw MalformedBytes("has an integer of more than 64 bits");
}
[[nodiscard]] inline std::uint32_t take_varint32(ByteReader& in) {
  const std::uint64_t value = take_varint(in);
  if (value > std::numeric_limits<std::uint32_t>::max())
    throw MalformedBytes("has a count of more than 32 bits");
  return static_cast<std::uint32_t>(value);
}

/// Difference with the sign in the lowest bit, so that small steps either way are short. Unsigned: it cannot
/// overflow.
[[nodiscard]] inline std::uint64_t zigzag(std::uint64_t now, std::uint64_t before) {
  const std::uint64_t difference = now - before;
  return (difference << 1) ^ (0 - (difference >> 63));
}
/// `now` from the difference and `before`.
[[nodiscard]] inline std::uint64_t unzigzag(std::uint64_t code, std::uint64_t before) {
  return before + ((code >> 1) ^ (0 - (code & 1)));
}

}  // namespace twofold
