#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace twofold {

/// Appends LEB128, low seven bits first.
inline void put_varint(std::vector<std::uint8_t>& bytes, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) bytes.push_back(static_cast<std::uint8_t>(value | 0x80));
  bytes.push_back(static_cast<std::uint8_t>(value));
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

/// Walks over untrusted bytes; the first failure is kept and every later read gives 0.
class ByteCursor {
 public:
  explicit ByteCursor(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  std::uint8_t byte() {
    if (at_ >= bytes_.size()) return fail("ends in the middle"), std::uint8_t{0};
    return bytes_[at_++];
  }
  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      const std::uint8_t next = byte();
      if (shift == 63 && next > 1) break;
      value |= static_cast<std::uint64_t>(next & 0x7F) << shift;
      if ((next & 0x80) == 0) return failure_.empty() ? value : 0;
    }
    fail("has an integer of more than 64 bits");
    return 0;
  }
  std::uint32_t varint32() {
    const std::uint64_t value = varint();
    if (value > std::numeric_limits<std::uint32_t>::max()) fail("has a count of more than 32 bits");
    return static_cast<std::uint32_t>(value);
  }
  std::span<const std::uint8_t> take(std::uint64_t size) {
    if (size > bytes_.size() - at_) return fail("is longer than the file"), std::span<const std::uint8_t>{};
    at_ += size;
    return bytes_.subspan(at_ - size, size);
  }
  void fail(const char* what) {
    if (failure_.empty()) failure_ = std::string(what) + " (byte " + std::to_string(at_) + ")";
  }
  [[nodiscard]] bool ok() const { return failure_.empty(); }
  [[nodiscard]] const std::string& failure() const { return failure_; }
  [[nodiscard]] std::size_t at() const { return at_; }
  [[nodiscard]] bool at_end() const { return at_ == bytes_.size(); }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  std::string failure_;
};

}  // namespace twofold
