// Something passes before a camera that stands still: the camera must not go along.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>

#include "fixtures/passing_strip.hpp"
#include "synthetic/synthetic_sequence.hpp"
#include "tests/engine/run_checks.hpp"

namespace twofold {
namespace {

using testing::PassingStrip;

constexpr int kFrames = 200;

/// Made once for all cases.
const synthetic::SyntheticSequence& courtyard() {
  static const synthetic::SyntheticSequence sequence = [] {
    synthetic::SyntheticOptions scene;
    scene.width = 320;
    scene.height = 240;
    scene.f = 210;
    scene.noise = 0;
    return synthetic::SyntheticSequence(scene);
  }();
  return sequence;
}

/// Farthest that the camera is said to have been from where it stands [m]; each frame must be tracked.
double farthest(const PassingStrip::Look& look) {
  PassingStrip strip(courtyard().render(0), look);
  const FrameFeed feed = [&, next = 0](Frame& frame) mutable {
    if (next++ == kFrames) return FrameStatus::kEnd;
    frame = strip.next();
    return FrameStatus::kFrame;
  };
  EngineOptions options;
  options.deterministic = true;
  std::atomic<bool> interrupted{false};
  const RunResult result = Engine(courtyard().rig(), options).run(feed, interrupted);
  double farthest = 0;
  for (const FrameRecord& record : result.frames) {
    EXPECT_EQ(record.state, FrameState::kTracked) << record.frame_index << ": " << describe(record.cause);
    if (record.state != FrameState::kTracked) continue;
    farthest = std::max(farthest, record.T_c_w_causal.unpacked().translation().norm());
    farthest = std::max(farthest, final_T_c_w(record, result.graph).translation().norm());
  }
  EXPECT_EQ(result.frames.size(), static_cast<std::size_t>(kFrames));
  return farthest;
}

TEST(PassingObject, DoesNotTakeTheCameraAlong) {
  for (const double share : {0.3, 0.4, 0.5}) {
    EXPECT_LT(farthest({.share = share}), 0.02) << share;
  }
}

TEST(PassingObject, DoesNotTakeTheCameraAlongWhenItIsSlow) {
  for (const double px_a_frame : {1.0, 2.5}) {
    EXPECT_LT(farthest({.share = 0.4, .px_a_frame = px_a_frame}), 0.02) << px_a_frame;
  }
}

/// What grows slowly must not become what is usual.
TEST(PassingObject, DoesNotTakeTheCameraAlongWhenItSetsOffSlowly) {
  for (const double share : {0.3, 0.4, 0.5}) {
    for (const double faster : {0.05, 0.1}) {
      SCOPED_TRACE(::testing::Message() << share << ", " << faster);
      EXPECT_LT(farthest({.share = share, .px_a_frame = 0, .faster = faster, .first_frame = 20}), 0.02);
    }
  }
}

/// So fast that points which it hides are found on it, by chance.
TEST(PassingObject, DoesNotTakeTheCameraAlongWhenItIsFast) {
  for (const double share : {0.3, 0.4, 0.5}) {
    EXPECT_LT(farthest({.share = share, .px_a_frame = 10}), 0.02) << share;
  }
}

/// A train that fills half of the image, so that dense alignment goes along with it from one frame to the
/// next and the points at rest are not even searched where they are.
TEST(PassingObject, DoesNotTakeTheCameraAlongWhenTheImageAsAWholeMoves) {
  for (const double px_a_frame : {15.0, 20.0, 30.0, 40.0}) {
    SCOPED_TRACE(px_a_frame);
    EXPECT_LT(farthest({.share = 0.5, .px_a_frame = px_a_frame, .disparity_px = 6}), 0.1);
  }
}

}  // namespace
}  // namespace twofold
