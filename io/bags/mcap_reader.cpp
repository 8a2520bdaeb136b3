// MCAP: https://mcap.dev/spec
#include <algorithm>
#include <map>
#include <optional>
#include <string_view>

#include "base/bytes.hpp"
#include "base/checksum.hpp"
#include "io/bags/bag_file.hpp"
#include "io/bags/bag_reader.hpp"
#include "io/bags/chunk_compression.hpp"
#include "io/bags/topic_types.hpp"

namespace twofold {
namespace mcap {  // names of the format
namespace {

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
constexpr std::size_t kRecordHeader = 9;                    // opcode, length
constexpr std::size_t kFooter = kRecordHeader + 8 + 8 + 4;  // the footer's record

enum Opcode : std::uint8_t {
  kFooterRecord = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kChunkIndex = 0x08,
  kDataEnd = 0x0F
};

struct McapRecord {
  std::uint8_t opcode = 0;
  std::span<const std::uint8_t> content;
};

McapRecord next_record(ByteReader& in) {
  const std::uint8_t opcode = in.u8();
  return {opcode, in.take(in.u64())};
}

/// Schemas and channels, wherever they stand: in the summary, in chunks, between them.
class Channels {
 public:
  void take(const McapRecord& record) {
    ByteReader in(record.content);
    if (record.opcode == kSchema) {
      const std::uint16_t id = in.u16();
      types_[id] = in.text();
    } else if (record.opcode == kChannel) {
      const std::uint16_t id = in.u16();
      const std::uint16_t schema = in.u16();
      const std::string name = in.text();
      if (known_[id]++ > 0) return;
      topics_.push_back({id, name, plain_type(types_[schema]), encoding_of(in.text())});
    }
  }
  [[nodiscard]] const std::vector<BagTopic>& topics() const { return topics_; }

 private:
  static MessageEncoding encoding_of(const std::string& name) {
    if (name == "ros1") return MessageEncoding::kRos1;
    return name == "cdr" ? MessageEncoding::kCdr : MessageEncoding::kOther;
  }

  std::map<std::uint16_t, std::string> types_;
  std::map<std::uint16_t, int> known_;
  std::vector<BagTopic> topics_;
};

class McapReader final : public BagReader {
 public:
  explicit McapReader(BagFile file) : file_(std::move(file)) {
    if (!begins_with_magic(0)) file_.fail(0, "is no MCAP file");
    if (!summary_is_usable()) guarded(at_, [this] { read_all_channels(); });
    rewind();
  }

  [[nodiscard]] const std::vector<BagTopic>& topics() const override { return channels_.topics(); }
  void select(std::set<std::uint32_t> topics) override {
    wanted_ = std::move(topics);
    rewind();
  }
  bool next(BagMessage& message) override {
    bool found = false;
    guarded(at_, [&] { found = find_next(message); });
    return found;
  }
  [[nodiscard]] BagMessage read_again(const MessagePlace& place, ChunkMemory& chunk) const override;
  [[nodiscard]] std::string fault() const override {
    return note_.empty() || fault_.empty() ? note_ + fault_ : note_ + "; " + fault_;
  }

 private:
  [[nodiscard]] bool begins_with_magic(std::uint64_t at) const {
    if (file_.size() < kMagic.size() || at > file_.size() - kMagic.size()) return false;
    const auto bytes = file_.part(at, kMagic.size());
    return std::equal(kMagic.begin(), kMagic.end(), bytes.begin(),
                      [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; });
  }
  /// What is malformed is named with the record that begins at `at`.
  template <class Function>
  void guarded(const std::uint64_t& at, Function function) const {
    try {
      function();
    } catch (const MalformedBytes& error) {
      file_.fail(at, error.what());
    }
  }
  void rewind() {
    at_ = kMagic.size();
    chunk_ = ByteReader({});
    fault_.clear();
  }

  /// False when the file has no summary, or one that is damaged: which `fault` says.
  bool summary_is_usable();
  bool read_summary();
  void read_all_channels();
  /// The record at at_, which then is behind it; nothing at the end of the data, or where the file is cut.
  std::optional<McapRecord> next_of_file();
  void open_chunk(std::uint64_t begin, const McapRecord& record);
  /// The records of a chunk, in `unpacked` where they are compressed.
  [[nodiscard]] static std::span<const std::uint8_t> records_of(const McapRecord& chunk,
                                                                std::vector<std::uint8_t>& unpacked);
  [[nodiscard]] bool is_wanted_chunk(std::uint64_t begin) const;
  bool find_next(BagMessage& message);
  bool take_message(const McapRecord& record, BagMessage& message) const;

  BagFile file_;
  Channels channels_;
  std::map<std::uint64_t, std::set<std::uint32_t>> chunk_topics_;  // of the summary, by where chunks begin
  std::set<std::uint32_t> wanted_;
  std::uint64_t at_ = 0;
  std::vector<std::uint8_t> unpacked_;
  ByteReader chunk_{{}};
  std::uint64_t chunk_begin_ = 0;
  std::string note_;   // of the summary
  std::string fault_;  // of the data
};

bool McapReader::summary_is_usable() {
  try {
    return read_summary();
  } catch (const MalformedBytes& error) {
    note_ = file_.name() + ": " + error.what() + "; the whole file was read for what it says";
  }
  channels_ = {};
  chunk_topics_.clear();
  return false;
}

/// Schemas, channels and which topics each chunk has. False when the file has none.
bool McapReader::read_summary() {
  if (file_.size() < 2 * kMagic.size() + kFooter || !begins_with_magic(file_.size() - kMagic.size()))
    return false;
  const std::uint64_t footer_at = file_.size() - kMagic.size() - kFooter;
  ByteReader in(file_.part(footer_at, kFooter));
  const McapRecord footer = next_record(in);
  if (footer.opcode != kFooterRecord) return false;
  ByteReader fields(footer.content);
  const std::uint64_t begin = fields.u64();
  (void)fields.u64();
  const std::uint32_t crc = fields.u32();
  if (begin == 0) return false;
  if (begin > footer_at) throw MalformedBytes("the summary is not where the footer says");
  const auto summary = file_.part(begin, footer_at - begin);
  // The checksum is of the summary and of the footer up to itself.
  if (crc != 0 && crc != crc32_of(file_.part(begin, file_.size() - kMagic.size() - 4 - begin)))
    throw MalformedBytes("the summary is damaged: its checksum does not fit");
  for (ByteReader records(summary); !records.at_end();) {
    const McapRecord record = next_record(records);
    channels_.take(record);
    if (record.opcode != kChunkIndex) continue;
    ByteReader index(record.content);
    (void)index.take(16);
    const std::uint64_t chunk = index.u64();
    (void)index.u64();
    // A file may do without: then nothing is known of the chunk.
    for (ByteReader offsets(index.block()); !offsets.at_end(); (void)offsets.u64())
      chunk_topics_[chunk].insert(offsets.u16());
  }
  return !channels_.topics().empty();
}

void McapReader::read_all_channels() {
  rewind();
  while (const auto record = next_of_file()) {
    channels_.take(*record);
    if (record->opcode != kChunk) continue;
    for (chunk_ = ByteReader(records_of(*record, unpacked_)); !chunk_.at_end();)
      channels_.take(next_record(chunk_));
  }
}

std::optional<McapRecord> McapReader::next_of_file() {
  const auto cut = [this]() -> std::optional<McapRecord> {
    fault_ = file_.name() + ": is cut short at byte " + std::to_string(at_);
    return std::nullopt;
  };
  if (file_.size() - at_ < kRecordHeader) return cut();
  ByteReader head(file_.part(at_, kRecordHeader));
  const std::uint8_t opcode = head.u8();
  const std::uint64_t length = head.u64();
  if (opcode == kDataEnd || opcode == kFooterRecord) return std::nullopt;
  if (length > file_.size() - at_ - kRecordHeader) return cut();
  const McapRecord record{opcode, file_.part(at_ + kRecordHeader, length)};
  at_ += kRecordHeader + length;
  return record;
}

void McapReader::open_chunk(std::uint64_t begin, const McapRecord& record) {
  chunk_ = ByteReader(records_of(record, unpacked_));
  chunk_begin_ = begin;
}

std::span<const std::uint8_t> McapReader::records_of(const McapRecord& chunk,
                                                     std::vector<std::uint8_t>& unpacked) {
  ByteReader in(chunk.content);
  (void)in.take(16);
  const std::uint64_t size = in.u64();
  const std::uint32_t crc = in.u32();
  const std::string compression = in.text();
  auto records = in.take(in.u64());
  if (!compression.empty()) {
    unpack_chunk(compression, records, size, unpacked);
    records = unpacked;
  }
  if (crc != 0 && crc != crc32_of(records))
    throw MalformedBytes("a chunk is damaged: its checksum does not fit");
  return records;
}

bool McapReader::is_wanted_chunk(std::uint64_t begin) const {
  const auto known = chunk_topics_.find(begin);
  if (known == chunk_topics_.end()) return true;
  return std::any_of(known->second.begin(), known->second.end(),
                     [this](std::uint32_t topic) { return wanted_.contains(topic); });
}

bool McapReader::find_next(BagMessage& message) {
  for (;;) {
    while (!chunk_.at_end()) {
      message.place = {chunk_begin_, chunk_.at()};
      if (take_message(next_record(chunk_), message)) return true;
    }
    const std::uint64_t begin = at_;
    const auto record = next_of_file();
    if (!record) return false;
    if (record->opcode == kChunk && is_wanted_chunk(begin)) open_chunk(begin, *record);
    message.place = {begin, std::nullopt};
    if (take_message(*record, message)) return true;
  }
}

BagMessage McapReader::read_again(const MessagePlace& place, ChunkMemory& chunk) const {
  BagMessage message;
  message.place = place;
  guarded(place.record, [&] {
    ByteReader head(file_.part(place.record, kRecordHeader));
    const std::uint8_t opcode = head.u8();
    McapRecord record{opcode, file_.part(place.record + kRecordHeader, head.u64())};
    if (place.in_chunk) {
      if (chunk.record != place.record) {
        chunk.record.reset();
        chunk.records = records_of(record, chunk.unpacked);
        chunk.record = place.record;
      }
      ByteReader records(chunk.records);
      (void)records.take(*place.in_chunk);
      record = next_record(records);
    }
    if (!take_message(record, message)) throw MalformedBytes("a message is not there any more");
  });
  return message;
}

bool McapReader::take_message(const McapRecord& record, BagMessage& message) const {
  if (record.opcode != kMessage) return false;
  ByteReader in(record.content);
  message.topic = in.u16();
  if (!wanted_.contains(message.topic)) return false;
  (void)in.u32();
  message.t_ns = static_cast<std::int64_t>(in.u64());
  (void)in.u64();
  message.data = in.rest();
  return true;
}

}  // namespace
}  // namespace mcap

std::unique_ptr<BagReader> open_mcap(const std::filesystem::path& file) {
  return std::make_unique<mcap::McapReader>(BagFile(file));
}

std::unique_ptr<BagReader> read_mcap(std::span<const std::uint8_t> bytes, const std::string& name) {
  return std::make_unique<mcap::McapReader>(BagFile(bytes, name));
}

}  // namespace twofold
