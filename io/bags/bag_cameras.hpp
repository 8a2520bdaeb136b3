#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "camera/calibration.hpp"
#include "io/bags/bag_reader.hpp"
#include "io/bags/ros_messages.hpp"

namespace twofold {

/// All of one name and type in a bag, as a subscriber would get it: a driver that starts again, and a merge
/// of bags, give the topic another id.
struct MergedTopic {
  std::string name, type;
  std::map<std::uint32_t, MessageEncoding> encodings;  ///< by the messages' id
};

/// A camera's topic in a bag.
struct BagCamera {
  MergedTopic images;  ///< sensor_msgs/Image or CompressedImage
  std::optional<MergedTopic> info;

  [[nodiscard]] bool compressed() const { return images.type == "sensor_msgs/CompressedImage"; }
  /// Images that were rectified before they were recorded, as ROS names them.
  [[nodiscard]] bool rectified() const;
};

/// The cameras of a rig.
struct BagCameras {
  BagCamera left;
  std::optional<BagCamera> right, depth;

  [[nodiscard]] SensorKind kind() const {
    return right ? SensorKind::kStereo : depth ? SensorKind::kRgbd : SensorKind::kMono;
  }
};

/// Names of topics, where the user gave them.
struct WantedTopics {
  std::optional<std::string> left, right, depth;
};

/// The given ones; where none is, what types and names say: two image topics that differ in left/right,
/// cam0/cam1, ...; one with "depth" in its name beside another; or the only one. Of the same camera rectified
/// images are taken before raw ones, and these before compressed ones. Throws MalformedBytes listing the
/// image topics when that does not decide, or when a given one is not there.
[[nodiscard]] BagCameras choose_cameras(const std::vector<BagTopic>& all, const WantedTopics& wanted);

/// What the cameras' CameraInfo says; `right` for stereo. Throws MalformedBytes when it says nothing (K is
/// zero), names a distortion that is not known, has more coefficients than are supported, the focal lengths
/// of a pair's P differ, or its rectified cameras do not stand side by side.
[[nodiscard]] Calibration calibration_of(const BagCameras& cameras, const CameraInfoMessage& left,
                                         const std::optional<CameraInfoMessage>& right);

/// Empty when depth images can be the left camera's, pixel by pixel; else by what their CameraInfo differ, as
/// those of depth that nobody registered do.
[[nodiscard]] std::string depth_mismatch(const CameraInfoMessage& left, const CameraInfoMessage& depth);

}  // namespace twofold
