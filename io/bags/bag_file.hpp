#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace twofold {

/// A file, or bytes in memory, of which parts are read: bags are larger than memory.
class BagFile {
 public:
  /// Throws IoError when there is no such file.
  explicit BagFile(const std::filesystem::path& file);
  BagFile(std::span<const std::uint8_t> bytes, std::string name) : name_(std::move(name)), bytes_(bytes) {}
  ~BagFile();
  BagFile(BagFile&& other) noexcept;
  BagFile& operator=(BagFile&&) = delete;

  [[nodiscard]] std::uint64_t size() const { return bytes_.size(); }
  /// The bytes from `begin` on; throws IoError when they are not all in the file.
  [[nodiscard]] std::span<const std::uint8_t> part(std::uint64_t begin, std::uint64_t size) const;
  [[nodiscard]] const std::string& name() const { return name_; }
  /// Throws IoError that names file and byte.
  [[noreturn]] void fail(std::uint64_t at, const std::string& what) const;

 private:
  std::string name_;
  std::span<const std::uint8_t> bytes_;
  bool mapped_ = false;
};

}  // namespace twofold
