#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "base/bytes.hpp"
#include "engine/logs/chunked_vector.hpp"
#include "engine/logs/input_fingerprint.hpp"
#include "engine/logs/log_file.hpp"

namespace twofold {

/// What one frame met in the tracker. Together with the input images it determines the tracker's step.
struct TrackerStep {
  enum class Fate : std::uint8_t { kTracked, kDropped };
  std::int64_t frame = 0;     ///< Frame::index, grows from record to record
  std::uint64_t version = 0;  ///< snapshot it was tracked against; 0 when dropped
  Fate fate = Fate::kTracked;
  std::uint8_t effort_level = 0;  ///< EffortLevel, 0 = nothing left out, <= 15
  std::uint32_t messages = 0;     ///< relocalisation answers consumed before it
  bool keyframe_withheld =
      false;  ///< the tracker got no buffer for a keyframe: the mapper is behind, or the map does not change
  bool operator==(const TrackerStep&) const = default;
};

/// What one mapper round consumed.
struct MapperStep {
  std::uint64_t version = 0;        ///< version it published, grows; 0 when it published none
  std::uint32_t proposals = 0;      ///< keyframe proposals consumed
  std::uint32_t loop_messages = 0;  ///< messages of the loop closer consumed
  bool operator==(const MapperStep&) const = default;
};

/// What one step of the loop closer consumed.
struct LoopStep {
  std::uint64_t version = 0;   ///< snapshot it used
  std::int64_t keyframe = -1;  ///< keyframe consumed, -1 = none
  std::uint32_t requests = 0;  ///< relocalisation requests consumed
  std::uint32_t refused = 0;   ///< its messages that found a ring full; 1 of a request: it was not looked at
  bool operator==(const LoopStep&) const = default;
};

/// Who saw what when, of a whole run. Steps are pure functions of their inputs, so that this and the
/// recording reproduce a threaded run one thread at a time.
struct Schedule {
  std::vector<TrackerStep> tracker;
  std::vector<MapperStep> mapper;
  std::vector<LoopStep> loop_closer;
  std::optional<InputFingerprint> input = {};  ///< nothing: of a run without a frame
  bool ended = true;  ///< false: of a run that was killed; the threads' last steps may not fit together
  bool operator==(const Schedule&) const = default;
};

// The file. All integers little-endian or LEB128 ("varint", low seven bits first):
//   "TWFSCHED", format version (1 byte)
//   sections of tracker (1), mapper (2), loop closer (3), any number in any order: id (1 byte), records
//   (varint), bytes (varint), the bytes, CRC-32 of all of the section before it (4 bytes)
//   likewise, once at most, the input (4): one record, InputFingerprint's two numbers of 8 bytes
//   an end section: id 0, no records, no bytes, its CRC-32
// While a run goes on each record is appended as a section. In the end they are merged into one a thread.

/// Records of one thread, each about three to five bytes: differences to the record before as
/// variable-length integers. Used by one thread at a time, without locks, and read when the run is over.
/// Appending allocates now and then, so the tracker leaves it to the thread that takes its frames back.
template <class Step>
class ScheduleStream {
 public:
  /// From here on, and before the first record, to `file`.
  void keep_in(std::shared_ptr<LogFile> file) { file_ = std::move(file); }
  void append(const Step& step);

  [[nodiscard]] std::uint64_t records() const { return records_; }
  /// Of the records in memory.
  [[nodiscard]] const ChunkedVector<std::uint8_t, 65536>& bytes() const { return bytes_; }

 private:
  ChunkedVector<std::uint8_t, 65536> bytes_;
  std::shared_ptr<LogFile> file_;
  ByteWriter record_, section_;  // what is being appended
  std::uint64_t records_ = 0;
  Step last_;
};

/// Those of a run.
struct ScheduleStreams {
  ScheduleStream<TrackerStep> tracker;
  ScheduleStream<MapperStep> mapper;
  ScheduleStream<LoopStep> loop_closer;
  std::optional<InputFingerprint> input;

  /// Before the first record, by the thread that pushes frames.
  void note_input(const InputFingerprint& fingerprint);
  /// Begins the file, to which all of them append from here on.
  void keep_in(const std::shared_ptr<LogFile>& file);
  /// After the last record: ends the file.
  static void end(LogFile& file);

 private:
  std::shared_ptr<LogFile> file_;
};

/// Writes streams that were kept in memory. False when the stream failed.
[[nodiscard]] bool write_schedule(std::ostream& out, const ScheduleStreams& schedule);

/// Parses a file's bytes, which may be anything. A file that lacks its end, up to a short section that may be
/// torn, is a schedule that has not `ended`. Error: which section is wrong, at which byte, and how.
[[nodiscard]] tl::expected<Schedule, std::string> parse_schedule(std::span<const std::uint8_t> file);
/// Reads the stream to its end and parses it; a file of more than 256 MiB is refused.
[[nodiscard]] tl::expected<Schedule, std::string> read_schedule(std::istream& in);

/// Of a file; one that cannot be opened is an error, too.
[[nodiscard]] tl::expected<Schedule, std::string> load_schedule(const std::filesystem::path& file);

/// The same schedule with one section a thread, whatever the threads' turns were. Errors as above; records
/// are not looked at.
[[nodiscard]] tl::expected<std::vector<std::uint8_t>, std::string> merge_schedule(
    std::span<const std::uint8_t> file);

}  // namespace twofold
