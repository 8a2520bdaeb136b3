// libFuzzer target for recordings of ROS: whatever the bytes, they are read or refused with an IoError. All
// messages are taken for each type that can be parsed, and cameras for what they say of their lens.
#include <span>

#include "base/bytes.hpp"
#include "base/check.hpp"
#include "io/bags/bag_cameras.hpp"
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
