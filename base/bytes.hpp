#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace twofold {

static_assert(std::endian::native == std::endian::little,
              "files are little-endian; other machines need a swap");

/// Bytes that are not what they should be; what() says how, and whoever knows the file adds which.
class MalformedBytes : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reads little-endian numbers and counted bytes one after the other; beyond the end it throws
/// MalformedBytes, so that no size that a file states is believed before the bytes are there.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

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

  /// Bytes read so far.
  [[nodiscard]] std::size_t at() const { return at_; }
  [[nodiscard]] std::size_t remaining() const { return bytes_.size() - at_; }
  [[nodiscard]] bool at_end() const { return remaining() == 0; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

/// Collects what ByteReader reads.
class ByteWriter {
 public:
  template <class T>
  void put(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    put_bytes({reinterpret_cast<const std::uint8_t*>(&value), sizeof(T)});
  }
  void put_bytes(std::span<const std::uint8_t> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  void clear() { bytes_.clear(); }  // keeps the memory
  [[nodiscard]] std::span<const std::uint8_t> bytes() const { return bytes_; }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  /// All of them; none stay.
  [[nodiscard]] std::vector<std::uint8_t> release() { return std::exchange(bytes_, {}); }

 private:
  std::vector<std::uint8_t> bytes_;
};

}  // namespace twofold
