// libFuzzer target for recordings of ROS: whatever the bytes, they are read or refused with an IoError. All
// messages are taken for each type that can be parsed.
#include <span>

#include "io/bags/bag_bytes.hpp"
#include "io/bags/bag_reader.hpp"
#include "io/bags/ros_messages.hpp"
#include "io/files/io_error.hpp"

namespace {

using namespace twofold;

template <class Parse>
void parse(const Parse& function, const BagMessage& message) {
  for (const MessageEncoding encoding : {MessageEncoding::kRos1, MessageEncoding::kCdr}) {
    try {
      (void)function(message.data, encoding);
    } catch (const MalformedBytes&) {
    }
  }
}

template <class Open>
void read_all(const Open& open, std::span<const std::uint8_t> bytes) {
  try {
    const auto reader = open(bytes, "fuzz");
    std::set<std::uint32_t> topics;
    for (const BagTopic& topic : reader->topics()) topics.insert(topic.id);
    reader->select(topics);
    BagMessage message;
    while (reader->next(message)) {
      parse(parse_image, message);
      parse(parse_compressed_image, message);
      parse(parse_camera_info, message);
    }
  } catch (const IoError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(data, size);
  read_all(read_mcap, bytes);
  read_all(read_rosbag, bytes);
  return 0;
}
