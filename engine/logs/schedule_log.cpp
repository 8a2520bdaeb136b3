#include "engine/logs/schedule_log.hpp"

#include <fstream>
#include <istream>
#include <iterator>
#include <ostream>
#include <string_view>

#include "engine/logs/byte_cursor.hpp"
#include "engine/logs/schedule_records.hpp"

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

/// CRC-32 of IEEE 802.3, bit by bit: a log is small and read once.
std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = ~0U;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (0xEDB88320U & (0U - (crc & 1U)));
  }
  return ~crc;
}

void put_header(std::vector<std::uint8_t>& file) {
  file.insert(file.end(), kMagic.begin(), kMagic.end());
  file.push_back(kFormatVersion);
}

/// What comes before a section's bytes.
void begin_section(std::vector<std::uint8_t>& file, std::uint8_t id, std::uint64_t records,
                   std::uint64_t bytes) {
  file.push_back(id);
  put_varint(file, records);
  put_varint(file, bytes);
}

void end_section(std::vector<std::uint8_t>& file, std::size_t begin) {
  const std::uint32_t crc = crc32(std::span(file).subspan(begin));
  for (unsigned shift = 0; shift < 32; shift += 8) file.push_back(static_cast<std::uint8_t>(crc >> shift));
}

void put_end(std::vector<std::uint8_t>& file) {
  const std::size_t begin = file.size();
  begin_section(file, kEnd, 0, 0);
  end_section(file, begin);
}

template <class Step>
void put_section(std::vector<std::uint8_t>& file, const ScheduleStream<Step>& stream) {
  const std::size_t begin = file.size();
  begin_section(file, section_id(Step()), stream.records(), stream.bytes().size());
  for (const auto& chunk : stream.bytes().chunks()) file.insert(file.end(), chunk.begin(), chunk.end());
  end_section(file, begin);
}

void put_number(std::vector<std::uint8_t>& file, std::uint64_t number) {
  for (unsigned shift = 0; shift < 64; shift += 8) file.push_back(static_cast<std::uint8_t>(number >> shift));
}

void put_input(std::vector<std::uint8_t>& file, const InputFingerprint& input) {
  const std::size_t begin = file.size();
  begin_section(file, kInput, 1, 2 * sizeof(std::uint64_t));
  put_number(file, input.rig);
  put_number(file, input.first_frame);
  end_section(file, begin);
}

struct Section {
  std::uint8_t id = kEnd;
  std::uint64_t records = 0;
  std::span<const std::uint8_t> bytes;
};

/// Walks over a file's sections. `ended` becomes true with the end section.
class ScheduleSectionReader {
 public:
  explicit ScheduleSectionReader(std::span<const std::uint8_t> file) : file_(file), in_(file) {
    read_header();
  }

  /// False at the end, where the file is torn, or when something is wrong.
  bool next(Section& section) {
    if (!error_.empty() || ended_ || in_.at_end()) return false;
    const std::size_t begin = in_.at();
    section.id = in_.byte();
    section.records = in_.varint();
    const std::uint64_t size = in_.varint();
    section.bytes = in_.take(size);
    const std::size_t end = in_.at();
    const auto stored = in_.take(4);
    if (section.id > kSectionNames.size())
      return fail("an unknown section (byte " + std::to_string(begin) + ")");
    if (!in_.ok()) {
      const bool torn = file_.size() - begin < kLargestTorn && size < kLargestTorn;
      return torn ? false : fail(name_of(section.id) + " " + in_.failure());
    }
    std::uint32_t crc = 0;
    for (unsigned i = 0; i < 4; ++i) crc |= static_cast<std::uint32_t>(stored[i]) << (8 * i);
    if (crc != crc32(file_.subspan(begin, end - begin)))
      return fail(name_of(section.id) + " is damaged: its checksum does not fit");
    if (section.id != kEnd) return true;
    ended_ = true;
    if (!in_.at_end()) return fail("has bytes after its end (byte " + std::to_string(in_.at()) + ")");
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
    const auto magic = in_.take(kMagic.size());
    const std::string_view text(reinterpret_cast<const char*>(magic.data()), magic.size());
    const std::uint8_t version = in_.byte();
    if (text != kMagic) {
      fail("header: this is no schedule log");
    } else if (!in_.ok()) {
      fail("header " + in_.failure());
    } else if (version != kFormatVersion) {
      fail("header: format version " + std::to_string(version) + ", this program reads " +
           std::to_string(kFormatVersion));
    }
  }

  std::span<const std::uint8_t> file_;
  ByteCursor in_;
  bool ended_ = false;
  std::string error_;
};

/// Empty, or what is wrong with the records.
template <class Step>
std::string parse_steps(const Section& section, Step& last, std::vector<Step>& steps) {
  ByteCursor in(section.bytes);
  // Every record has at least one byte: a false count is found before any record is looked at.
  if (section.records > section.bytes.size()) in.fail("announces more records than it has bytes");
  for (std::uint64_t i = 0; i < section.records && in.ok(); ++i) {
    const Step step = decode_step(in, last);
    check_order(in, step, steps.empty() ? nullptr : &last);
    steps.push_back(step);
    last = step;
  }
  if (in.ok() && !in.at_end()) in.fail("has bytes left over");
  return in.ok() ? "" : ScheduleSectionReader::name_of(section.id) + " " + in.failure() + " of its records";
}

std::uint64_t number_at(std::span<const std::uint8_t> bytes) {
  std::uint64_t number = 0;
  for (unsigned i = 0; i < 8; ++i) number |= static_cast<std::uint64_t>(bytes[i]) << (8 * i);
  return number;
}

/// Empty, or what is wrong with it.
std::string parse_input(const Section& section, std::optional<InputFingerprint>& input) {
  if (input) return ScheduleSectionReader::name_of(kInput) + " is there twice";
  if (section.records != 1 || section.bytes.size() != 2 * sizeof(std::uint64_t))
    return ScheduleSectionReader::name_of(kInput) + " is not one record of 16 bytes";
  input = {number_at(section.bytes), number_at(section.bytes.subspan(sizeof(std::uint64_t)))};
  return "";
}

std::string parse_section(const Section& section, TrackerStep& tracker, MapperStep& mapper,
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
    section_.insert(section_.end(), record_.begin(), record_.end());
    end_section(section_, 0);
    file_->append(section_);
  } else {
    for (const std::uint8_t byte : record_) bytes_.push_back(byte);
  }
  last_ = step;
  ++records_;
}
template class ScheduleStream<TrackerStep>;
template class ScheduleStream<MapperStep>;
template class ScheduleStream<LoopStep>;

void ScheduleStreams::keep_in(const std::shared_ptr<LogFile>& file) {
  std::vector<std::uint8_t> header;
  put_header(header);
  file->append(header);
  file_ = file;
  tracker.keep_in(file);
  mapper.keep_in(file);
  loop_closer.keep_in(file);
}

void ScheduleStreams::note_input(const InputFingerprint& fingerprint) {
  input = fingerprint;
  if (!file_) return;
  std::vector<std::uint8_t> section;
  put_input(section, fingerprint);
  file_->append(section);
}

void ScheduleStreams::end(LogFile& file) {
  std::vector<std::uint8_t> section;
  put_end(section);
  file.append(section);
}

bool write_schedule(std::ostream& out, const ScheduleStreams& schedule) {
  std::vector<std::uint8_t> file;
  put_header(file);
  put_section(file, schedule.tracker);
  put_section(file, schedule.mapper);
  put_section(file, schedule.loop_closer);
  if (schedule.input) put_input(file, *schedule.input);
  put_end(file);
  out.write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  return static_cast<bool>(out.flush());
}

tl::expected<Schedule, std::string> parse_schedule(std::span<const std::uint8_t> file) {
  ScheduleSectionReader reader(file);
  Schedule schedule;
  TrackerStep tracker;
  MapperStep mapper;
  LoopStep loop_closer;
  for (Section section; reader.next(section);) {
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
  for (Section section; reader.next(section);) {
    auto& of_thread = bytes.at(section.id - 1U);
    of_thread.insert(of_thread.end(), section.bytes.begin(), section.bytes.end());
    records.at(section.id - 1U) += section.records;
  }
  if (!reader.error().empty()) return tl::make_unexpected(reader.error());
  std::vector<std::uint8_t> merged;
  put_header(merged);
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    if (n + 1 == kInput && records[n] == 0) continue;
    const std::size_t begin = merged.size();
    begin_section(merged, static_cast<std::uint8_t>(n + 1), records[n], bytes[n].size());
    merged.insert(merged.end(), bytes[n].begin(), bytes[n].end());
    end_section(merged, begin);
  }
  if (reader.ended()) put_end(merged);
  return merged;
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
