#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

namespace twofold {

/// How a message's fields are laid out.
enum class MessageEncoding : std::uint8_t {
  kRos1,  ///< ROS 1: little-endian, packed
  kCdr,   ///< ROS 2: OMG CDR, each number at a multiple of its size
  kOther
};

struct BagTopic {
  std::uint32_t id = 0;  ///< as messages of it have
  std::string name;
  std::string type;  ///< "sensor_msgs/Image"; ROS 2's "sensor_msgs/msg/Image" is given as that
  MessageEncoding encoding = MessageEncoding::kOther;
};

/// Where a message stands in its file, for BagReader::read_again.
struct MessagePlace {
  std::uint64_t record = 0;  ///< byte at which its record begins, or its chunk's
  std::optional<std::uint64_t>
      in_chunk;  ///< byte of the unpacked chunk at which its own begins, if it is in one
};

struct BagMessage {
  std::uint32_t topic = 0;
  std::int64_t t_ns = 0;  ///< when it was recorded
  std::span<const std::uint8_t> data;
  MessagePlace place;
};

/// The chunk that a message was read again from: the next one is mostly of the same.
struct ChunkMemory {
  std::optional<std::uint64_t> record;    ///< MessagePlace::record of what is in `records`
  std::span<const std::uint8_t> records;  ///< in `unpacked` or in the file
  std::vector<std::uint8_t> unpacked;
};

/// The messages of a recording of ROS, in the order of the file. All functions throw IoError naming the file,
/// the byte and what is wrong there.
class BagReader {
 public:
  virtual ~BagReader() = default;

  /// All that the file says it holds; from its summary, or, without a whole one, from a pass over all of it.
  [[nodiscard]] virtual const std::vector<BagTopic>& topics() const = 0;
  /// next gives the messages of these topics only, from the first one on.
  virtual void select(std::set<std::uint32_t> topics) = 0;
  /// False at the end. The data are valid until the next call of anything.
  virtual bool next(BagMessage& message) = 0;
  /// A message that next gave. Any thread, beside next, each with a chunk memory of its own; the data are
  /// valid until that is used again. Throws IoError, too, when the file has changed and the message is not
  /// there.
  [[nodiscard]] virtual BagMessage read_again(const MessagePlace& place, ChunkMemory& chunk) const = 0;
  /// Empty, or where the file is cut short: its recorder was killed, and what came before was given; and that
  /// its summary is damaged, without which all of it was read.
  [[nodiscard]] virtual std::string fault() const = 0;
};

/// MCAP (https://mcap.dev/spec), chunks plain, lz4 or zstd; format 2.0 of ROS 1's bags
/// (http://wiki.ros.org/Bags/Format/2.0), chunks plain, lz4 or bz2.
[[nodiscard]] std::unique_ptr<BagReader> open_mcap(const std::filesystem::path& file);
[[nodiscard]] std::unique_ptr<BagReader> open_rosbag(const std::filesystem::path& file);

/// The same from a file's bytes, which must outlive the reader; `name` is for messages.
[[nodiscard]] std::unique_ptr<BagReader> read_mcap(std::span<const std::uint8_t> bytes,
                                                   const std::string& name);
[[nodiscard]] std::unique_ptr<BagReader> read_rosbag(std::span<const std::uint8_t> bytes,
                                                     const std::string& name);

}  // namespace twofold
