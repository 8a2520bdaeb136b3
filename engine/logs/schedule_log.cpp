#include "engine/logs/schedule_log.hpp"

#include <algorithm>
#include <fstream>
#include <istream>
#include <iterator>
#include <ostream>
#include <string_view>

#include "base/checksum.hpp"
#include "engine/logs/schedule_records.hpp"
#include "engine/logs/varint.hpp"

namespace twofold {
namespace {

constexpr std::string_view kMagic = "TWFSCHED";
constexpr std::uint8_t kFormatVersion = 5;
constexpr std::array<const char*, 4> kSectionNames = {"tracker", "mapper", "loop closer", "input"};
constexpr std::uint8_t kEnd = 0;  // id of the end section; the others are 1, 2, 3, 4
constexpr std::uint8_t kInput = 4;
constexpr std::uint64_t kLargestTorn = 128;  // [bytes] one record's section is shorter
constexpr std::size_t kLargestFile = std::size_t{256} << 20;

constexpr std::uint8_t section_id(const TrackerStep&) {
  return 1;
}
constexpr std::uint8_t section_id(const MapperStep&) {
  return 2;
}
constexpr std::uint8_t section_id(const LoopStep&) {
  return 3;
}

void put_header(ByteWriter& file) {
  for (const char c : kMagic) file.put(c);
  file.put(kFormatVersion);
}

/// What comes before a section's bytes.
void begin_section(ByteWriter& file, std::uint8_t id, std::uint64_t records, std::uint64_t bytes) {
  file.put(id);
  put_varint(file, records);
  put_varint(file, bytes);
}

void end_section(ByteWriter& file, std::size_t begin) {
  file.put(crc32_of(file.bytes().subspan(begin)));
}

void put_end(ByteWriter& file) {
  const std::size_t begin = file.size();
  begin_section(file, kEnd, 0, 0);
  end_section(file, begin);
}

template <class Step>
void put_section(ByteWriter& file, const ScheduleStream<Step>& stream) {
  const std::size_t begin = file.size();
  begin_section(file, section_id(Step()), stream.records(), stream.bytes().size());
  for (const auto& chunk : stream.bytes().chunks()) file.put_bytes(chunk);
  end_section(file, begin);
}

void put_input(ByteWriter& file, const InputFingerprint& input) {
  const std::size_t begin = file.size();
  begin_section(file, kInput, 1, 2 * sizeof(std::uint64_t));
  file.put(input.rig);
  file.put(input.first_frame);
  end_section(file, begin);
}

struct ScheduleSection {
  std::uint8_t id = kEnd;
  std::uint64_t records = 0;
  std::span<const std::uint8_t> bytes;
};

/// Where reading stopped, for people.
std::string place_of(const ByteReader& in) {
  return " (byte " + std::to_string(in.at()) + ")";
}

/// Walks over a file's sections. `ended` becomes true with the end section.
class ScheduleSectionReader {
 public:
  explicit ScheduleSectionReader(std::span<const std::uint8_t> file) : file_(file), in_(file) {
    read_header();
  }

  /// False at the end, where the file is torn, or when something is wrong.
  bool next(ScheduleSection& section) {
    if (!error_.empty() || ended_ || in_.at_end()) return false;
    const std::size_t begin = in_.at();
    section.id = in_.u8();
    if (section.id > kSectionNames.size())
      return fail("an unknown section (byte " + std::to_string(begin) + ")");
    std::uint64_t size = 0;
    try {
      section.records = take_varint(in_);
      size = take_varint(in_);
      if (size > in_.remaining()) throw MalformedBytes("is longer than the file");
      section.bytes = in_.take(size);
      const std::uint32_t crc = crc32_of(file_.subspan(begin, in_.at() - begin));
      if (in_.u32() != crc) return fail(name_of(section.id) + " is damaged: its checksum does not fit");
    } catch (const MalformedBytes& error) {
      const bool torn = file_.size() - begin < kLargestTorn && size < kLargestTorn;
      return torn ? false : fail(name_of(section.id) + " " + error.what() + place_of(in_));
    }
    if (section.id != kEnd) return true;
    ended_ = true;
    if (!in_.at_end()) return fail("has bytes after its end" + place_of(in_));
    return false;
  }
  [[nodiscard]] bool ended() const { return ended_; }
  /// Empty, or what is wrong.
  [[nodiscard]] const std::string& error() const { return error_; }
  bool fail(const std::string& what) {
    error_ = "schedule log: " + what;
    return false;
  }
  [[nodiscard]] static std::string name_of(std::uint8_t id) {
    return id == kEnd ? "end section" : std::string("section '") + kSectionNames.at(id - 1U) + "'";
  }

 private:
  void read_header() {
    const auto magic = in_.take(std::min(kMagic.size(), in_.remaining()));
    if (std::string_view(reinterpret_cast<const char*>(magic.data()), magic.size()) != kMagic) {
      fail("header: this is no schedule log");
    } else if (in_.at_end()) {
      fail("header ends in the middle" + place_of(in_));
    } else if (const std::uint8_t version = in_.u8(); version != kFormatVersion) {
      fail("header: format version " + std::to_string(version) + ", this program reads " +
           std::to_string(kFormatVersion));
    }
  }

  std::span<const std::uint8_t> file_;
  ByteReader in_;
  bool ended_ = false;
  std::string error_;
};

/// Empty, or what is wrong with the records.
template <class Step>
std::string parse_steps(const ScheduleSection& section, Step& last, std::vector<Step>& steps) {
  ByteReader in(section.bytes);
  try {
    // Every record has at least one byte: a false count is found before any record is looked at.
    if (section.records > section.bytes.size())
      throw MalformedBytes("announces more records than it has bytes");
    for (std::uint64_t i = 0; i < section.records; ++i) {
      const Step step = decode_step(in, last);
      check_order(step, steps.empty() ? nullptr : &last);
      steps.push_back(step);
      last = step;
    }
    if (!in.at_end()) throw MalformedBytes("has bytes left over");
  } catch (const MalformedBytes& error) {
    return ScheduleSectionReader::name_of(section.id) + " " + error.what() + place_of(in) + " of its records";
  }
  return "";
}

/// Empty, or what is wrong with it.
std::string parse_input(const ScheduleSection& section, std::optional<InputFingerprint>& input) {
  if (input) return ScheduleSectionReader::name_of(kInput) + " is there twice";
  if (section.records != 1 || section.bytes.size() != 2 * sizeof(std::uint64_t))
    return ScheduleSectionReader::name_of(kInput) + " is not one record of 16 bytes";
  ByteReader in(section.bytes);
  input = {in.u64(), in.u64()};
  return "";
}

std::string parse_section(const ScheduleSection& section, TrackerStep& tracker, MapperStep& mapper,
                          LoopStep& loop_closer, Schedule& schedule) {
  switch (section.id) {
    case 1:
      return parse_steps(section, tracker, schedule.tracker);
    case 2:
      return parse_steps(section, mapper, schedule.mapper);
    case 3:
      return parse_steps(section, loop_closer, schedule.loop_closer);
    default:
      return parse_input(section, schedule.input);
  }
}

}  // namespace

template <class Step>
void ScheduleStream<Step>::append(const Step& step) {
  record_.clear();
  encode_step(record_, step, last_);
  if (file_) {
    section_.clear();
    begin_section(section_, section_id(step), 1, record_.size());
    section_.put_bytes(record_.bytes());
    end_section(section_, 0);
    file_->append(section_.bytes());
  } else {
    for (const std::uint8_t byte : record_.bytes()) bytes_.push_back(byte);
  }
  last_ = step;
  ++records_;
}
template class ScheduleStream<TrackerStep>;
template class ScheduleStream<MapperStep>;
template class ScheduleStream<LoopStep>;

void ScheduleStreams::keep_in(const std::shared_ptr<LogFile>& file) {
  ByteWriter header;
  put_header(header);
  file->append(header.bytes());
  file_ = file;
  tracker.keep_in(file);
  mapper.keep_in(file);
  loop_closer.keep_in(file);
}

void ScheduleStreams::note_input(const InputFingerprint& fingerprint) {
  input = fingerprint;
  if (!file_) return;
  ByteWriter section;
  put_input(section, fingerprint);
  file_->append(section.bytes());
}

void ScheduleStreams::end(LogFile& file) {
  ByteWriter section;
  put_end(section);
  file.append(section.bytes());
}

bool write_schedule(std::ostream& out, const ScheduleStreams& schedule) {
  ByteWriter file;
  put_header(file);
  put_section(file, schedule.tracker);
  put_section(file, schedule.mapper);
  put_section(file, schedule.loop_closer);
  if (schedule.input) put_input(file, *schedule.input);
  put_end(file);
  out.write(reinterpret_cast<const char*>(file.bytes().data()), static_cast<std::streamsize>(file.size()));
  return static_cast<bool>(out.flush());
}

tl::expected<Schedule, std::string> parse_schedule(std::span<const std::uint8_t> file) {
  ScheduleSectionReader reader(file);
  Schedule schedule;
  TrackerStep tracker;
  MapperStep mapper;
  LoopStep loop_closer;
  for (ScheduleSection section; reader.next(section);) {
    const std::string wrong = parse_section(section, tracker, mapper, loop_closer, schedule);
    if (!wrong.empty()) reader.fail(wrong);
  }
  if (!reader.error().empty()) return tl::make_unexpected(reader.error());
  schedule.ended = reader.ended();
  return schedule;
}

tl::expected<std::vector<std::uint8_t>, std::string> merge_schedule(std::span<const std::uint8_t> file) {
  ScheduleSectionReader reader(file);
  std::array<std::vector<std::uint8_t>, kSectionNames.size()> bytes;
  std::array<std::uint64_t, kSectionNames.size()> records{};
  for (ScheduleSection section; reader.next(section);) {
    auto& of_thread = bytes.at(section.id - 1U);
    of_thread.insert(of_thread.end(), section.bytes.begin(), section.bytes.end());
    records.at(section.id - 1U) += section.records;
  }
  if (!reader.error().empty()) return tl::make_unexpected(reader.error());
  ByteWriter merged;
  put_header(merged);
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    if (n + 1 == kInput && records[n] == 0) continue;
    const std::size_t begin = merged.size();
    begin_section(merged, static_cast<std::uint8_t>(n + 1), records[n], bytes[n].size());
    merged.put_bytes(bytes[n]);
    end_section(merged, begin);
  }
  if (reader.ended()) put_end(merged);
  return merged.release();
}

tl::expected<Schedule, std::string> read_schedule(std::istream& in) {
  std::vector<std::uint8_t> file;
  std::array<char, 65536> block{};
  while (in.read(block.data(), block.size()), in.gcount() > 0) {
    file.insert(file.end(), block.begin(), block.begin() + in.gcount());
    if (file.size() > kLargestFile)
      return tl::make_unexpected(std::string("schedule log: more than 256 MiB"));
  }
  if (in.bad()) return tl::make_unexpected(std::string("schedule log: reading failed"));
  return parse_schedule(file);
}

tl::expected<Schedule, std::string> load_schedule(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return tl::make_unexpected(std::string("cannot be opened"));
  return read_schedule(in);
}

}  // namespace twofold
