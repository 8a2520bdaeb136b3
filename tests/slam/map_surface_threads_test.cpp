// Who makes the surface of a run, and who asks it, on threads of their own.
#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <thread>

#include "twofold/slam.hpp"
#include "twofold/source.hpp"
#include "twofold/surface.hpp"

namespace twofold {
namespace {

class MapSurfaceThreadsTest : public ::testing::Test {
 protected:
  /// The next keyframe is in the surface, and an update by itself; false at the end of the source.
  bool add_keyframe() {
    for (FrameView frame; source_.next(frame);) {
      slam_.push(frame);
      const auto pose = slam_.latest();
      if (!pose || !pose->keyframe) continue;
      surface_.add(frame, pose->frame);
      surface_.update(slam_.map());
      return true;
    }
    return false;
  }

  Source source_{"synthetic:desk?sensor=rgbd&width=160&height=120&rounds=1&frames=120"};
  Slam slam_{source_.rig(), {.mode = RunMode::kDeterministic}};
  MapSurface surface_{slam_.map(), {.model = {.voxel_size = 0.04}}};
};

TEST_F(MapSurfaceThreadsTest, LendsItsSnapshotsWhileItIsUpdated) {
  const MapSurface& lent = surface_;
  EXPECT_EQ(lent.snapshot().map_version(), 0U) << "before the first update";
  std::atomic<bool> done{false};
  int versions = 0;
  std::thread planner([&] {
    for (std::uint64_t newest = 0; !done;) {
      const SurfaceSnapshot now = lent.snapshot();
      EXPECT_GE(now.map_version(), newest);
      if (now.map_version() == newest) continue;
      newest = now.map_version();
      ++versions;
      EXPECT_GT(now.mesh().triangles.size(), 0U);
      EXPECT_GT(lent.memory_bytes(), 0U);
    }
  });
  int keyframes = 0;
  while (add_keyframe()) ++keyframes;
  done = true;
  planner.join();
  EXPECT_GE(keyframes, 3);
  EXPECT_GE(versions, 2);
}

TEST_F(MapSurfaceThreadsTest, ASnapshotIsAskedWhileTheSurfaceGoesOn) {
  ASSERT_TRUE(add_keyframe() && add_keyframe());
  const SurfaceSnapshot asked = surface_.snapshot(), unasked = surface_.snapshot();
  const std::size_t triangles = asked.mesh().triangles.size();
  std::atomic<bool> done{false};
  int answers = 0;
  std::thread planner([&] {
    do {
      EXPECT_EQ(unasked.mesh().triangles.size(), triangles);
      ++answers;
    } while (!done);
  });
  while (add_keyframe()) continue;
  done = true;
  planner.join();
  EXPECT_GT(answers, 0);
}

}  // namespace
}  // namespace twofold
