#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace twofold {

/// A file that grows while a run goes on. It holds whole appends only, but for a torn last one when the
/// process was killed within a write.
///
/// Roles: any thread but the tracker's appends, under a lock that is held for a copy; one thread (LogWriter)
/// writes what waits, without the lock. What waits is bounded. After an append beyond the bound, or a write
/// that failed, further bytes are only counted as lost: the file holds all up to there, and nothing after it.
class LogFile {
 public:
  static constexpr std::size_t kMostWaiting = std::size_t{16} << 20;  ///< [bytes]

  /// Makes the file, or empties it. Throws std::runtime_error naming it and the reason.
  explicit LogFile(const std::filesystem::path& file);
  /// A file without a name on the disk of `folder`, which is gone with this object. Throws as above.
  [[nodiscard]] static std::shared_ptr<LogFile> unnamed(const std::filesystem::path& folder);
  ~LogFile();
  LogFile(const LogFile&) = delete;
  LogFile& operator=(const LogFile&) = delete;

  /// All of the bytes, or none.
  void append(std::span<const std::uint8_t> bytes);
  void append(std::string_view text) {
    append(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  }
  /// More than half of what may wait does: who can slow down should.
  [[nodiscard]] bool behind() const;

  /// The writing thread's.
  void write_waiting();

  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] std::uint64_t written() const;  ///< [bytes]
  /// Empty, or which file lost how many bytes, and why.
  [[nodiscard]] std::string error() const;

 private:
  LogFile(std::string name, int descriptor);

  const std::string name_;
  const int descriptor_;
  std::vector<std::uint8_t> writing_;  // the writing thread's
  mutable std::mutex lock_;            // guards what follows
  std::vector<std::uint8_t> waiting_;
  std::uint64_t written_ = 0, lost_ = 0;
  std::string failure_;
};

}  // namespace twofold
