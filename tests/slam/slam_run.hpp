#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "slam/conversions.hpp"
#include "tests/engine/swaying_camera.hpp"
#include "twofold/opencv.hpp"
#include "twofold/slam.hpp"

namespace twofold::testing {

/// The swaying camera's frames (rendered once for all tests) for class Slam.
class SlamRun : public SwayingCamera {
 protected:
  static FrameView view(std::size_t i) {
    const Frame& frame = frames_->at(i);
    return stereo_frame(frame.t_ns, frame.left, frame.right);
  }
  static CameraRig rig() { return to_camera_rig(small_rig()); }
  static SlamOptions deterministic() { return {.mode = RunMode::kDeterministic}; }

  /// None is dropped.
  static void push_all(Slam& slam, std::size_t begin = 0, std::size_t end = kFrames) {
    for (std::size_t i = begin; i < end; ++i) {
      ASSERT_TRUE(slam.wait_for_room(60'000'000'000));
      const PushResult pushed = slam.push(view(i));
      ASSERT_TRUE(pushed) << pushed.reason;
    }
  }
};

}  // namespace twofold::testing
