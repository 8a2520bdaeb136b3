#pragma once

#include <algorithm>
#include <vector>

#include "tests/engine/run_checks.hpp"

namespace twofold::testing {

/// A camera that sways through a textured room; rendered once for all tests.
class SwayingCamera : public ::testing::Test {
 protected:
  static constexpr int kFrames = 45;

  static SE3 T_c_w(int i) {
    const double s = 0.03 * i;
    return SE3(SO3::exp(Vector3(0.04 * std::sin(3 * s), 0.25 * std::sin(2 * s), 0.03 * std::sin(s))),
               Vector3(0.5 * std::sin(2 * s), 0.1 * std::sin(3 * s), -0.6 * s));
  }

  static void SetUpTestSuite() { frames_ = new std::vector<Frame>(render_walk(T_c_w, 0, kFrames, 5)); }
  static void TearDownTestSuite() {
    delete frames_;
    frames_ = nullptr;
  }

  static FrameFeed feed(int count = kFrames, FrameStatus last = FrameStatus::kEnd) {
    return [count, last, next = 0](Frame& frame) mutable {
      if (next == count) return last;
      frame = (*frames_)[static_cast<std::size_t>(next++)];
      return FrameStatus::kFrame;
    };
  }

  static RunResult run(const EngineOptions& options) { return run_engine(options, feed()); }

  /// Largest distance between tracked and true camera positions, in the first camera's frame.
  static double worst_position_error(const RunResult& result) {
    double worst = 0;
    for (const FrameRecord& record : result.frames) {
      const SE3 T_c_first_true = T_c_w(static_cast<int>(record.frame_index)) * T_c_w(0).inverse();
      worst = std::max(worst, position_error(record, result.graph, T_c_first_true));
    }
    return worst;
  }

  static inline std::vector<Frame>* frames_ = nullptr;
};

}  // namespace twofold::testing
