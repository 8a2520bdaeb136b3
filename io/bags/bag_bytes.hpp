#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace twofold {

/// Bytes that are not what they should be; what() says how.
class MalformedBytes : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reads little-endian numbers and counted bytes one after the other; beyond the end it throws
/// MalformedBytes, so that no size of a file is believed before the bytes are there.
class BagBytes {
 public:
  explicit BagBytes(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <class T>
  T number() {
    static_assert(std::is_arithmetic_v<T>);
    T value;
    std::memcpy(&value, take(sizeof(T)).data(), sizeof(T));
    return value;
  }
  std::uint8_t u8() { return number<std::uint8_t>(); }
  std::uint16_t u16() { return number<std::uint16_t>(); }
  std::uint32_t u32() { return number<std::uint32_t>(); }
  std::uint64_t u64() { return number<std::uint64_t>(); }
  /// A length of four bytes and so many bytes.
  std::span<const std::uint8_t> block() { return take(u32()); }
  std::string text() {
    const auto bytes = block();
    return {bytes.begin(), bytes.end()};
  }
  std::span<const std::uint8_t> take(std::uint64_t size) {
    if (size > remaining()) throw MalformedBytes("ends in the middle");
    at_ += size;
    return bytes_.subspan(at_ - size, size);
  }
  std::span<const std::uint8_t> rest() { return take(remaining()); }

  [[nodiscard]] std::size_t at() const { return at_; }
  [[nodiscard]] std::size_t remaining() const { return bytes_.size() - at_; }
  [[nodiscard]] bool at_end() const { return remaining() == 0; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

}  // namespace twofold
