#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace twofold {

/// Images of one instant as the sensor (after rectification) delivered them.
///
/// left: CV_8UC1. right: CV_8UC1 of the same size for stereo, else empty. depth: CV_16UC1 of the same size,
/// registered to left, in units of Rig::depth_unit, 0 = no reading, for RGB-D, else empty.
struct Frame {
  std::int64_t index = 0;  ///< counts from 0 in the order of the source, dropped frames included
  std::int64_t t_ns = 0;   ///< capture time
  cv::Mat left;
  cv::Mat right;
  cv::Mat depth;
};

/// What came of asking for the next frame.
enum class FrameStatus : std::uint8_t {
  kFrame,  ///< the frame was filled
  kEnd,    ///< no more frames
  kError   ///< the input is broken; who was asked says how (FrameSource::error)
};

}  // namespace twofold
