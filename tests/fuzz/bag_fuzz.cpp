// libFuzzer target for recordings of ROS: whatever the bytes, they are read or refused with an IoError. All
// messages are taken for each type that can be parsed, images in colour, too, and cameras for what they say
// of their lens; and each message stands at its place.
#include <algorithm>
#include <span>

#include "base/bytes.hpp"
#include "base/check.hpp"
#include "io/bags/bag_cameras.hpp"
#include "io/bags/bag_reader.hpp"
#include "io/bags/ros_images.hpp"
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

void look_through_lens(const CameraInfoMessage& info) {
  const Calibration calibration = calibration_of(BagCameras(), info, {});
  if (!calibration.invalid_reason().empty()) return;
  const CameraModel& camera = calibration.left;
  for (const double share : {0.0, 0.3, 1.0}) {
    const auto ray = camera.unproject(share * Vector2(camera.pinhole.width, camera.pinhole.height));
    if (!ray) continue;
    TWOFOLD_CHECK(ray->allFinite(), "where a lens sees a pixel");
    TWOFOLD_CHECK(camera.distortion.reaches(ray->head<2>()), "what a lens sees");
  }
}

void expect_again(const BagReader& reader, const BagMessage& message, ChunkMemory& chunk) {
  const BagMessage again = reader.read_again(message.place, chunk);
  TWOFOLD_CHECK(again.topic == message.topic && again.t_ns == message.t_ns, "a message's head again");
  TWOFOLD_CHECK(std::equal(again.data.begin(), again.data.end(), message.data.begin(), message.data.end()),
                "a message's data again");
}

template <class Open>
void read_all(const Open& open, std::span<const std::uint8_t> bytes) {
  try {
    const auto reader = open(bytes, "fuzz");
    std::set<std::uint32_t> topics;
    for (const BagTopic& topic : reader->topics()) topics.insert(topic.id);
    reader->select(topics);
    BagMessage message;
    ChunkMemory chunk;
    while (reader->next(message)) {
      expect_again(*reader, message, chunk);
      parse([](auto bytes, auto encoding) { (void)colour_image(parse_image(bytes, encoding)); }, message);
      parse([](auto bytes, auto encoding) { (void)colour_image(parse_compressed_image(bytes, encoding)); },
            message);
      parse([](auto bytes, auto encoding) { look_through_lens(parse_camera_info(bytes, encoding)); },
            message);
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
