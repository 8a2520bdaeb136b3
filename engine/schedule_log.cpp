#include "engine/schedule_log.hpp"

#include <istream>
#include <iterator>
#include <optional>
#include <ostream>
#include <string_view>

#include "engine/byte_cursor.hpp"
#include "engine/schedule_records.hpp"

namespace twofold {
namespace {

constexpr std::string_view kMagic = "TWFSCHED";
constexpr std::uint8_t kFormatVersion = 3;
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

template <class Step>
std::optional<std::string> parse_steps(std::span<const std::uint8_t> payload, std::uint64_t records,
                                       std::vector<Step>& steps) {
  ByteCursor in(payload);
  // Every record has at least one byte: a false count cannot make us reserve more than the file is long.
  if (records > payload.size()) in.fail("announces more records than it has bytes");
  if (in.ok()) steps.reserve(records);
  Step last;
  for (std::uint64_t i = 0; i < records && in.ok(); ++i) {
    const Step step = decode_step(in, last);
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
  for (const auto& chunk : stream.bytes().chunks()) file.insert(file.end(), chunk.begin(), chunk.end());
  const std::uint32_t crc = crc32(std::span(file).subspan(begin));
  for (unsigned shift = 0; shift < 32; shift += 8) file.push_back(static_cast<std::uint8_t>(crc >> shift));
}

std::optional<std::string> parse_section(std::span<const std::uint8_t> file, ByteCursor& in,
                                         std::size_t number, Schedule& schedule) {
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
  record_.clear();
  encode_step(record_, step, last_);
  for (const std::uint8_t byte : record_) bytes_.push_back(byte);
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
  ByteCursor in(file);
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
