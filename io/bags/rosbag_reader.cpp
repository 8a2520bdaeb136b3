// Bags of ROS 1: http://wiki.ros.org/Bags/Format/2.0
#include <algorithm>
#include <map>
#include <optional>
#include <string_view>

#include "base/bytes.hpp"
#include "io/bags/bag_file.hpp"
#include "io/bags/bag_reader.hpp"
#include "io/bags/chunk_compression.hpp"
#include "io/bags/topic_types.hpp"

namespace twofold {
namespace rosbag {  // names of the format
namespace {

constexpr std::string_view kMagic = "#ROSBAG V2.0\n";

enum Operation : std::uint8_t { kMessageData = 0x02, kBagHeader = 0x03, kChunk = 0x05, kConnection = 0x07 };

using Fields = std::map<std::string, std::span<const std::uint8_t>, std::less<>>;

/// "name=value", each with its length before it.
Fields fields_of(std::span<const std::uint8_t> header) {
  Fields fields;
  for (ByteReader in(header); !in.at_end();) {
    const auto field = in.block();
    const auto equals = std::find(field.begin(), field.end(), '=');
    if (equals == field.end()) throw MalformedBytes("a header field without '='");
    fields[std::string(field.begin(), equals)] =
        field.subspan(static_cast<std::size_t>(equals - field.begin()) + 1);
  }
  return fields;
}

template <class T>
T number(const Fields& fields, const char* name) {
  const auto field = fields.find(name);
  if (field == fields.end() || field->second.size() != sizeof(T))
    throw MalformedBytes(std::string("a record without a valid field '") + name + "'");
  return ByteReader(field->second).number<T>();
}

std::string text(const Fields& fields, const char* name) {
  const auto field = fields.find(name);
  if (field == fields.end()) throw MalformedBytes(std::string("a record without the field '") + name + "'");
  return {field->second.begin(), field->second.end()};
}

struct RosbagRecord {
  Fields fields;
  std::uint8_t operation = 0;
  std::span<const std::uint8_t> data;
};

RosbagRecord next_record(ByteReader& in) {
  RosbagRecord record;
  record.fields = fields_of(in.block());
  record.operation = number<std::uint8_t>(record.fields, "op");
  record.data = in.block();
  return record;
}

class RosbagReader final : public BagReader {
 public:
  explicit RosbagReader(BagFile file) : file_(std::move(file)) {
    const auto begin = file_.part(0, std::min<std::uint64_t>(file_.size(), kMagic.size()));
    if (!std::equal(kMagic.begin(), kMagic.end(), begin.begin(), begin.end()))
      file_.fail(0, "is no bag of format 2.0");
    guarded(at_, [this] { read_topics(); });
    rewind();
  }

  [[nodiscard]] const std::vector<BagTopic>& topics() const override { return topics_; }
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
  [[nodiscard]] std::string fault() const override { return fault_; }

 private:
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
  /// From the connections that are repeated behind the chunks; without an index from all chunks.
  void read_topics();
  void take_connection(const RosbagRecord& record);
  std::optional<RosbagRecord> next_of_file();
  void open_chunk(std::uint64_t begin, const RosbagRecord& record);
  /// The records of a chunk, in `unpacked` where they are compressed.
  [[nodiscard]] static std::span<const std::uint8_t> records_of(const RosbagRecord& chunk,
                                                                std::vector<std::uint8_t>& unpacked);
  bool find_next(BagMessage& message);
  bool take_message(const RosbagRecord& record, BagMessage& message) const;

  BagFile file_;
  std::vector<BagTopic> topics_;
  std::set<std::uint32_t> wanted_;
  std::uint64_t at_ = kMagic.size();
  std::vector<std::uint8_t> unpacked_;
  ByteReader chunk_{{}};
  std::uint64_t chunk_begin_ = 0;
  std::string fault_;
};

void RosbagReader::read_topics() {
  rewind();
  const auto header = next_of_file();
  if (!header || header->operation != kBagHeader) throw MalformedBytes("the bag's header is missing");
  const auto index = number<std::uint64_t>(header->fields, "index_pos");
  const bool indexed = index != 0;
  if (indexed && (index < at_ || index > file_.size()))
    throw MalformedBytes("the index is not where the header says");
  if (indexed) at_ = index;
  while (const auto record = next_of_file()) {
    take_connection(*record);
    if (indexed || record->operation != kChunk) continue;
    for (chunk_ = ByteReader(records_of(*record, unpacked_)); !chunk_.at_end();)
      take_connection(next_record(chunk_));
  }
}

void RosbagReader::take_connection(const RosbagRecord& record) {
  if (record.operation != kConnection) return;
  const auto id = number<std::uint32_t>(record.fields, "conn");
  const bool known =
      std::any_of(topics_.begin(), topics_.end(), [id](const BagTopic& topic) { return topic.id == id; });
  if (known) return;
  topics_.push_back({id, text(record.fields, "topic"), plain_type(text(fields_of(record.data), "type")),
                     MessageEncoding::kRos1});
}

/// The record at at_, which then is behind it; nothing at the end, or where the file is cut.
std::optional<RosbagRecord> RosbagReader::next_of_file() {
  if (at_ == file_.size()) return std::nullopt;
  std::uint64_t end = at_;
  for (int block = 0; block < 2; ++block) {  // header, data
    const std::uint64_t left = file_.size() - end;
    const std::uint64_t size = left < 4 ? left : ByteReader(file_.part(end, 4)).u32();
    if (left < 4 || size > left - 4) {
      fault_ = file_.name() + ": is cut short at byte " + std::to_string(at_);
      return std::nullopt;
    }
    end += 4 + size;
  }
  ByteReader in(file_.part(at_, end - at_));
  const RosbagRecord record = next_record(in);
  at_ = end;
  return record;
}

void RosbagReader::open_chunk(std::uint64_t begin, const RosbagRecord& record) {
  chunk_ = ByteReader(records_of(record, unpacked_));
  chunk_begin_ = begin;
}

std::span<const std::uint8_t> RosbagReader::records_of(const RosbagRecord& chunk,
                                                       std::vector<std::uint8_t>& unpacked) {
  const std::string compression = text(chunk.fields, "compression");
  const auto size = number<std::uint32_t>(chunk.fields, "size");
  if (compression == "none") return chunk.data;
  unpack_chunk(compression, chunk.data, size, unpacked);
  return unpacked;
}

bool RosbagReader::find_next(BagMessage& message) {
  for (;;) {
    while (!chunk_.at_end()) {
      message.place = {chunk_begin_, chunk_.at()};
      if (take_message(next_record(chunk_), message)) return true;
    }
    const std::uint64_t begin = at_;
    const auto record = next_of_file();
    if (!record) return false;
    if (record->operation == kChunk) open_chunk(begin, *record);
  }
}

BagMessage RosbagReader::read_again(const MessagePlace& place, ChunkMemory& chunk) const {
  BagMessage message;
  message.place = place;
  guarded(place.record, [&] {
    if (chunk.record != place.record) {
      chunk.record.reset();
      ByteReader file(file_.part(place.record, file_.size() - place.record));
      chunk.records = records_of(next_record(file), chunk.unpacked);
      chunk.record = place.record;
    }
    ByteReader records(chunk.records);
    (void)records.take(place.in_chunk.value_or(0));
    if (!take_message(next_record(records), message)) throw MalformedBytes("a message is not there any more");
  });
  return message;
}

bool RosbagReader::take_message(const RosbagRecord& record, BagMessage& message) const {
  if (record.operation != kMessageData) return false;
  message.topic = number<std::uint32_t>(record.fields, "conn");
  if (!wanted_.contains(message.topic)) return false;
  const auto time = number<std::uint64_t>(record.fields, "time");  // seconds, then nanoseconds
  message.t_ns =
      static_cast<std::int64_t>(time & 0xFFFFFFFFU) * 1'000'000'000 + static_cast<std::int64_t>(time >> 32);
  message.data = record.data;
  return true;
}

}  // namespace
}  // namespace rosbag

std::unique_ptr<BagReader> open_rosbag(const std::filesystem::path& file) {
  return std::make_unique<rosbag::RosbagReader>(BagFile(file));
}

std::unique_ptr<BagReader> read_rosbag(std::span<const std::uint8_t> bytes, const std::string& name) {
  return std::make_unique<rosbag::RosbagReader>(BagFile(bytes, name));
}

}  // namespace twofold
