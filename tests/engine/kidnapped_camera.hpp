#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "loopclosure/default_vocabulary.hpp"
#include "tests/engine/run_checks.hpp"

namespace twofold::testing {

/// A camera that turns by 90 degrees in a textured room; rendered once for all tests.
class KidnappedCamera : public ::testing::Test {
 protected:
  static constexpr int kFrames = 45;
  static constexpr int kCovered = 5;
  static constexpr int kCarriedTo = 6;  // frame whose place the camera is carried to
  static constexpr int kAfter = 12;     // frames from there on, then it stands

  static void SetUpTestSuite() {
    mapped_ = new std::vector<Frame>(render_walk(turning_walk, 0, kFrames, 5));
    elsewhere_ = new std::vector<Frame>(render_walk(turning_walk, kCarriedTo, kCarriedTo + kAfter, 77));
  }
  static void TearDownTestSuite() {
    delete mapped_;
    delete elsewhere_;
  }

  static SE3 T_c_w(int i) { return turning_walk(i); }

  /// Number of the frame of the walk shown as frame i; -1 while the lens is covered.
  static int shown(int i) {
    if (i < kFrames) return i;
    return i < kFrames + kCovered ? -1 : kCarriedTo + std::min(i - kFrames - kCovered, kAfter - 1);
  }
  static bool after_kidnapping(const FrameRecord& record) { return record.frame_index >= kFrames + kCovered; }

  /// The walk, a hand over the lens, and then, without having seen the way, a place of the walk, or of
  /// another room.
  static FrameFeed kidnapped(bool to_another_room, int after = kAfter) {
    return [to_another_room, after, next = 0](Frame& frame) mutable {
      if (next == kFrames + kCovered + after) return FrameStatus::kEnd;
      const int i = shown(next);
      if (i < 0) {
        frame.left = cv::Mat(240, 320, CV_8UC1, cv::Scalar(12));
        frame.right = frame.left;
      } else if (next >= kFrames && to_another_room) {
        frame = (*elsewhere_)[static_cast<std::size_t>(i - kCarriedTo)];
      } else {
        frame = (*mapped_)[static_cast<std::size_t>(i)];
      }
      number_frame(frame, next);
      ++next;
      return FrameStatus::kFrame;
    };
  }

  static EngineOptions options(bool recognise = true) {
    EngineOptions options;
    options.deterministic = true;
    if (recognise) options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
    return options;
  }
  static inline std::vector<Frame>*mapped_ = nullptr, *elsewhere_ = nullptr;
};

}  // namespace twofold::testing
