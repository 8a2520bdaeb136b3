#include "engine/schedule_log.hpp"

#include <istream>
#include <iterator>
#include <limits>
#include <optional>
#include <ostream>
#include <string_view>
#include <type_traits>

#include "geometry/check.hpp"

namespace twofold {
namespace {

constexpr std::string_view kMagic = "TWFSCHED";
constexpr std::uint8_t kFormatVersion = 2;
constexpr std::array<const char*, 3> kSectionNames = {"tracker", "mapper", "loop closer"};
constexpr std::size_t kLargestFile = std::size_t{256} << 20;

/// CRC-32 of IEEE 802.3, bit by bit: a log is small and read once.
std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = ~0U;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (0xEDB88320U & (0U - (crc & 1U)));
  }
  return ~crc;
}

void put_varint(std::vector<std::uint8_t>& bytes, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) bytes.push_back(static_cast<std::uint8_t>(value | 0x80));
  bytes.push_back(static_cast<std::uint8_t>(value));
}

/// Difference with the sign in the lowest bit, so that small steps either way are short. Unsigned: it cannot
/// overflow.
std::uint64_t zigzag(std::uint64_t now, std::uint64_t before) {
  const std::uint64_t difference = now - before;
  return (difference << 1) ^ (0 - (difference >> 63));
}
std::uint64_t unzigzag(std::uint64_t code, std::uint64_t before) {
  return before + ((code >> 1) ^ (0 - (code & 1)));
}

/// Walks over untrusted bytes; the first failure is kept and every later read gives 0.
class Cursor {
 public:
  explicit Cursor(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

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

// Tracker record: flags (fate, has messages, has refused, keyframe withheld, level in the upper half), frame
// and version as differences, then what the flags announce.
void encode(std::vector<std::uint8_t>& bytes, const TrackerStep& step, const TrackerStep& last) {
  TWOFOLD_CHECK(step.degrade_level <= 15, "degrade level");
  const unsigned flags = static_cast<unsigned>(step.fate) | (step.messages ? 2U : 0U) |
                         (step.refused ? 4U : 0U) | (step.keyframe_withheld ? 8U : 0U) |
                         static_cast<unsigned>(step.degrade_level) << 4;
  bytes.push_back(static_cast<std::uint8_t>(flags));
  put_varint(bytes, zigzag(static_cast<std::uint64_t>(step.frame), static_cast<std::uint64_t>(last.frame)));
  put_varint(bytes, zigzag(step.version, last.version));
  if (step.messages) put_varint(bytes, step.messages);
  if (step.refused) put_varint(bytes, step.refused);
}
TrackerStep decode(Cursor& in, const TrackerStep& last) {
  TrackerStep step;
  const unsigned flags = in.byte();
  step.fate = static_cast<TrackerStep::Fate>(flags & 1U);
  step.degrade_level = static_cast<std::uint8_t>(flags >> 4);
  step.keyframe_withheld = (flags & 8U) != 0;
  step.frame = static_cast<std::int64_t>(unzigzag(in.varint(), static_cast<std::uint64_t>(last.frame)));
  step.version = unzigzag(in.varint(), last.version);
  if (flags & 2U) step.messages = in.varint32();
  if (flags & 4U) step.refused = in.varint32();
  return step;
}

void encode(std::vector<std::uint8_t>& bytes, const MapperStep& step, const MapperStep& last) {
  put_varint(bytes, zigzag(step.version, last.version));
  for (const std::uint32_t count : {step.proposals, step.loop_messages, step.iterations, step.refused}) {
    put_varint(bytes, count);
  }
}
MapperStep decode(Cursor& in, const MapperStep& last) {
  MapperStep step;
  step.version = unzigzag(in.varint(), last.version);
  for (std::uint32_t* count : {&step.proposals, &step.loop_messages, &step.iterations, &step.refused}) {
    *count = in.varint32();
  }
  return step;
}

void encode(std::vector<std::uint8_t>& bytes, const LoopStep& step, const LoopStep& last) {
  put_varint(bytes, zigzag(step.version, last.version));
  put_varint(bytes,
             zigzag(static_cast<std::uint64_t>(step.keyframe), static_cast<std::uint64_t>(last.keyframe)));
  put_varint(bytes, step.requests);
  put_varint(bytes, step.refused);
}
LoopStep decode(Cursor& in, const LoopStep& last) {
  LoopStep step;
  step.version = unzigzag(in.varint(), last.version);
  step.keyframe = static_cast<std::int64_t>(unzigzag(in.varint(), static_cast<std::uint64_t>(last.keyframe)));
  step.requests = in.varint32();
  step.refused = in.varint32();
  return step;
}

/// Content rule beyond the form of a record.
void check_order(Cursor& in, const TrackerStep& step, const TrackerStep* last) {
  if (step.frame < 0 || (last != nullptr && step.frame <= last->frame)) in.fail("has frames out of order");
}
void check_order(Cursor&, const MapperStep&, const MapperStep*) {}
void check_order(Cursor& in, const LoopStep& step, const LoopStep*) {
  if (step.keyframe < -1) in.fail("has a negative keyframe number");
}

template <class Step>
std::optional<std::string> parse_steps(std::span<const std::uint8_t> payload, std::uint64_t records,
                                       std::vector<Step>& steps) {
  Cursor in(payload);
  // Every record has at least one byte: a false count cannot make us reserve more than the file is long.
  if (records > payload.size()) in.fail("announces more records than it has bytes");
  if (in.ok()) steps.reserve(records);
  Step last;
  for (std::uint64_t i = 0; i < records && in.ok(); ++i) {
    const Step step = decode(in, last);
    check_order(in, step, i == 0 ? nullptr : &last);
    steps.push_back(step);
    last = step;
  }
  if (in.ok() && !in.at_end()) in.fail("has bytes left over");
  if (in.ok()) return std::nullopt;
  return in.failure() + " of its records";
}

template <class Step>
void put_section(std::vector<std::uint8_t>& file, std::uint8_t id, const ScheduleStream<Step>& stream) {
  const std::size_t begin = file.size();
  file.push_back(id);
  put_varint(file, stream.records());
  put_varint(file, stream.bytes().size());
  file.insert(file.end(), stream.bytes().begin(), stream.bytes().end());
  const std::uint32_t crc = crc32(std::span(file).subspan(begin));
  for (unsigned shift = 0; shift < 32; shift += 8) file.push_back(static_cast<std::uint8_t>(crc >> shift));
}

std::optional<std::string> parse_section(std::span<const std::uint8_t> file, Cursor& in, std::size_t number,
                                         Schedule& schedule) {
  const std::size_t begin = in.at();
  const std::uint8_t id = in.byte();
  if (in.ok() && id != number + 1) in.fail("is missing or has a wrong number");
  const std::uint64_t records = in.varint();
  const std::uint64_t size = in.varint();
  const auto payload = in.take(size);
  const std::size_t end = in.at();
  const auto stored = in.take(4);
  if (!in.ok()) return in.failure();
  std::uint32_t crc = 0;
  for (unsigned i = 0; i < 4; ++i) crc |= static_cast<std::uint32_t>(stored[i]) << (8 * i);
  if (crc != crc32(file.subspan(begin, end - begin))) return "is damaged: its checksum does not fit";
  switch (number) {
    case 0:
      return parse_steps(payload, records, schedule.tracker);
    case 1:
      return parse_steps(payload, records, schedule.mapper);
    default:
      return parse_steps(payload, records, schedule.loop_closer);
  }
}

}  // namespace

template <class Step>
void ScheduleStream<Step>::append(const Step& step) {
  encode(bytes_, step, last_);
  last_ = step;
  ++records_;
}
template class ScheduleStream<TrackerStep>;
template class ScheduleStream<MapperStep>;
template class ScheduleStream<LoopStep>;

bool write_schedule(std::ostream& out, const ScheduleStream<TrackerStep>& tracker,
                    const ScheduleStream<MapperStep>& mapper, const ScheduleStream<LoopStep>& loop_closer) {
  std::vector<std::uint8_t> file(kMagic.begin(), kMagic.end());
  file.push_back(kFormatVersion);
  file.push_back(static_cast<std::uint8_t>(kSectionNames.size()));
  put_section(file, 1, tracker);
  put_section(file, 2, mapper);
  put_section(file, 3, loop_closer);
  out.write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  return static_cast<bool>(out.flush());
}

tl::expected<Schedule, std::string> parse_schedule(std::span<const std::uint8_t> file) {
  Cursor in(file);
  const auto error = [](const std::string& what) { return tl::make_unexpected("schedule log: " + what); };
  const auto magic = in.take(kMagic.size());
  if (!in.ok() || std::string_view(reinterpret_cast<const char*>(magic.data()), magic.size()) != kMagic) {
    return error("header: this is no schedule log");
  }
  const std::uint8_t version = in.byte();
  if (in.ok() && version != kFormatVersion) {
    return error("header: format version " + std::to_string(version) + ", this program reads " +
                 std::to_string(kFormatVersion));
  }
  if (in.byte() != kSectionNames.size()) in.fail("number of sections is wrong");
  if (!in.ok()) return error("header " + in.failure());
  Schedule schedule;
  for (std::size_t number = 0; number < kSectionNames.size(); ++number) {
    if (auto wrong = parse_section(file, in, number, schedule)) {
      return error(std::string("section '") + kSectionNames[number] + "' " + *wrong);
    }
  }
  if (!in.at_end()) return error("has bytes after its last section (byte " + std::to_string(in.at()) + ")");
  return schedule;
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

}  // namespace twofold
