#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace twofold {

/// What a log file holds, and what becomes of it when something was lost.
struct LogContent {
  std::string records = "records";  ///< what an append is called when people are told of those missing
  bool goes_on = false;             ///< after a loss: records stand for themselves; false: nothing follows it
  std::string loss;                 ///< what a loss means, if that has to be said
};

/// A file that grows while a run goes on. It holds whole appends only, but for a torn last one when the
/// process was killed within a write.
///
/// Roles: any thread but the tracker's appends, under a lock that is held for a copy; one thread (LogWriter)
/// writes what waits, without the lock. When the disk does not take it (it is full), the file is cut back to
/// its last whole append, and each turn tries again. What waits is bounded; an append beyond the bound is
/// lost, and counted.
class LogFile {
 public:
  static constexpr std::size_t kMostWaiting = std::size_t{16} << 20;  ///< [bytes], 16 more for each append
  static constexpr std::int64_t kNoTime = std::numeric_limits<std::int64_t>::min();

  /// Makes the file, or empties it. Throws std::runtime_error naming it and the reason.
  explicit LogFile(const std::filesystem::path& file, LogContent content = {});
  /// A file without a name on the disk of `folder`, which is gone with this object. Throws as above.
  [[nodiscard]] static std::shared_ptr<LogFile> unnamed(const std::filesystem::path& folder,
                                                        LogContent content = {});
  ~LogFile();
  LogFile(const LogFile&) = delete;
  LogFile& operator=(const LogFile&) = delete;

  /// All of the bytes, or none of them and false.
  /// @param t_ns  when people are told of a loss, this says where it is
  bool append(std::span<const std::uint8_t> bytes, std::int64_t t_ns = kNoTime);
  bool append(std::string_view text, std::int64_t t_ns = kNoTime) {
    return append(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), t_ns);
  }
  /// More than half of what may wait does, and the disk takes it: who can slow down should.
  [[nodiscard]] bool behind() const;

  /// The writing thread's.
  void write_waiting();
  /// The writing thread's last call: what still waits is lost.
  void give_up();

  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] std::uint64_t written() const;  ///< [bytes]
  /// Empty, or a sentence: what this file lost, when and why, and that it waits for room on the disk.
  [[nodiscard]] std::string error() const;

 private:
  struct Batch {
    struct Append {
      std::uint32_t size = 0;
      std::int64_t t_ns = kNoTime;
    };
    std::vector<std::uint8_t> bytes;
    std::vector<Append> appends;
  };
  struct Loss {
    std::uint64_t records = 0;
    std::int64_t first_t_ns = kNoTime, last_t_ns = kNoTime;
    void add(std::int64_t t_ns);
  };

  LogFile(std::string name, int descriptor, LogContent content);
  /// False when nothing waits any more, or the disk does not take it.
  [[nodiscard]] bool write_batch();

  const std::string name_;
  const int descriptor_;
  const LogContent content_;
  Batch writing_;            // the writing thread's
  mutable std::mutex lock_;  // guards what follows
  Batch waiting_;            // behind writing_
  std::size_t in_hand_ = 0;  // bytes of writing_
  std::size_t appends_in_hand_ = 0;
  std::uint64_t written_ = 0;
  Loss loss_;
  std::string why_;      // of the first loss
  std::string blocked_;  // why the disk takes nothing at present; empty: it does
};

}  // namespace twofold
