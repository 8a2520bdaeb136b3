#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
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

struct BagMessage {
  std::uint32_t topic = 0;
  std::int64_t t_ns = 0;  ///< when it was recorded
  std::span<const std::uint8_t> data;
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
