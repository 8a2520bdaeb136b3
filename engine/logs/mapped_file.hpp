#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/logs/log_file.hpp"

namespace twofold {

/// The bytes that were written to a log file, as memory that the kernel may put back on the disk. Changes go
/// to the file.
class MappedFile {
 public:
  MappedFile() = default;
  /// All that was written so far. Throws std::runtime_error when it cannot be mapped.
  explicit MappedFile(const LogFile& file);
  ~MappedFile();
  MappedFile(MappedFile&& other) noexcept : bytes_(other.bytes_) { other.bytes_ = {}; }
  MappedFile& operator=(MappedFile&& other) noexcept;

  [[nodiscard]] std::span<std::uint8_t> bytes() const { return bytes_; }

 private:
  std::span<std::uint8_t> bytes_;
};

}  // namespace twofold
