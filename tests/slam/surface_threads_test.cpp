// A surface that is made, asked about and saved by threads of the user's while a run reads, tracks and maps;
// run by scripts/test_sanitized tsan, too.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "fixtures/bag_writer.hpp"
#include "tests/io/scratch_folder.hpp"
#include "tests/slam/slam_run.hpp"
#include "twofold/source.hpp"
#include "twofold/surface.hpp"

namespace twofold {
namespace {

constexpr int kRedness = 40;

/// No grey image has these colours.
cv::Mat in_blue(const cv::Mat& grey) {
  const std::vector<cv::Mat> channels{grey, 0.5 * grey, cv::Mat(grey.size(), CV_8UC1, cv::Scalar(kRedness))};
  cv::Mat bgr;
  cv::merge(channels, bgr);
  return bgr;
}

/// Keyframes on their way from the tracker's thread to the surface's.
class KeyframeQueue {
 public:
  /// The reader's thread, before the frame is pushed; frames are numbered as they come.
  void show(const FrameView& frame) {
    const std::scoped_lock lock(mutex_);
    under_way_.emplace(next_++, frame);
  }
  /// The tracker's thread.
  void decide(const PoseEstimate& pose) {
    const std::scoped_lock lock(mutex_);
    if (pose.keyframe) keyframes_.emplace_back(pose.frame, under_way_.at(pose.frame));
    under_way_.erase(pose.frame);
    changed_.notify_one();
  }
  void end() {
    const std::scoped_lock lock(mutex_);
    ended_ = true;
    changed_.notify_one();
  }
  /// Waits for the next; nothing when the last was taken.
  std::optional<std::pair<std::int64_t, FrameView>> take() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return ended_ || !keyframes_.empty(); });
    if (keyframes_.empty()) return std::nullopt;
    auto oldest = std::move(keyframes_.front());
    keyframes_.pop_front();
    return oldest;
  }

 private:
  std::mutex mutex_;  // guards all
  std::condition_variable changed_;
  std::int64_t next_ = 0;
  std::map<std::int64_t, FrameView> under_way_;
  std::deque<std::pair<std::int64_t, FrameView>> keyframes_;
  bool ended_ = false;
};

/// All snapshots, as they come. Who asks about them synchronises with who makes them in one direction only: a
/// lock would hide from ThreadSanitizer what a snapshot shares with a surface that goes on changing.
class Snapshots {
 public:
  static constexpr std::size_t kMost = 100;

  /// One thread.
  void add(SurfaceSnapshot snapshot) {
    const std::size_t number = count_.load(std::memory_order_relaxed);
    all_.at(number) = std::move(snapshot);
    count_.store(number + 1, std::memory_order_release);
  }
  void end() { ended_.store(true, std::memory_order_release); }
  /// Other threads: each that is the newest when the one before was visited, to the last.
  template <class Visit>
  void visit_each(const Visit& visit) const {
    for (std::size_t visited = 0;;) {
      const bool ends = ended_.load(std::memory_order_acquire);
      const std::size_t count = count_.load(std::memory_order_acquire);
      if (count > visited) {
        visit(count - 1, all_[count - 1]);
        visited = count;
      } else if (ends) {
        return;
      } else {
        std::this_thread::yield();
      }
    }
  }
  [[nodiscard]] const SurfaceSnapshot& last() const { return all_.at(count_ - 1); }

 private:
  std::array<SurfaceSnapshot, kMost> all_;
  std::atomic<std::size_t> count_{0};
  std::atomic<bool> ended_{false};
};

class SurfaceThreadsTest : public testing::SlamRun {
 protected:
  /// The walk as a recording of raw images in colour, whose chunks are unpacked again for a keyframe's
  /// colours.
  static std::string write_bag(const ScratchFolder& folder) {
    const Rig rig = testing::small_rig();
    const PinholeCamera& c = rig.camera;
    testing::WrittenBag bag;
    bag.topics = {{"/stereo/left/image_rect", "sensor_msgs/Image"},
                  {"/stereo/right/image_rect", "sensor_msgs/Image"},
                  {"/stereo/left/camera_info", "sensor_msgs/CameraInfo"},
                  {"/stereo/right/camera_info", "sensor_msgs/CameraInfo"}};
    for (const std::uint32_t side : {0U, 1U}) {
      testing::WrittenCameraInfo info;
      info.width = static_cast<std::uint32_t>(c.width);
      info.height = static_cast<std::uint32_t>(c.height);
      info.K = {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1};
      info.P = {c.fx, 0, c.cx, side == 0 ? 0 : -c.fx * rig.baseline, 0, c.fy, c.cy, 0, 0, 0, 1, 0};
      bag.messages.push_back({2 + side, 0, camera_info_message(MessageEncoding::kCdr, info)});
    }
    for (const Frame& frame : *frames_)
      for (const std::uint32_t side : {0U, 1U}) {
        const cv::Mat image = in_blue(side == 0 ? frame.left : frame.right);
        bag.messages.push_back(
            {side, frame.t_ns, testing::image_message(MessageEncoding::kCdr, frame.t_ns, image, "bgr8")});
      }
    const testing::Bytes bytes = mcap_file(bag, {.compression = "lz4", .chunk_messages = 7});
    return "mcap:" + folder.write("walk.mcap", {bytes.begin(), bytes.end()}).string();
  }
};

/// A position before the first camera, and a box around it.
void ask(const SurfaceSnapshot& snapshot) {
  const DistanceBox box{{-0.3, -0.3, 0.7}, {0.3, 0.3, 1.3}, 0.1, 0.3};
  (void)snapshot.at({0, 0, 1});
  (void)snapshot.distances(box).at({0, 0, 1});
  (void)snapshot.memory_bytes();
}

/// Share of a mesh's vertices with the recording's colours, which JPEG keeps coarsely at edges.
double share_in_blue(const SurfaceMesh& mesh) {
  std::size_t right = 0;
  for (const auto& [red, green, blue] : mesh.colours)
    right += std::abs(red - kRedness) < 14 && std::abs(green - 0.5 * blue) < 14 ? 1U : 0U;
  return static_cast<double>(right) / static_cast<double>(std::max<std::size_t>(1, mesh.colours.size()));
}

TEST_F(SurfaceThreadsTest, IsMadeAskedAndSavedWhileFramesAreReadAndTracked) {
  const ScratchFolder folder;
  Source source(write_bag(folder));
  Slam slam(source.rig(), {});
  KeyframeQueue queue;
  Snapshots snapshots;
  int keyframes = 0, saved = 0;
  slam.on_pose([&](const PoseEstimate& pose) { queue.decide(pose); });
  std::thread maker([&] {
    MapSurface surface(slam.map(), {.model = {.voxel_size = 0.05}});
    while (auto keyframe = queue.take()) {
      surface.add(source.in_colour(keyframe->second), keyframe->first);  // read again beside the reader
      surface.update(slam.map());
      snapshots.add(surface.snapshot());
      ++keyframes;
    }
    surface.update(slam.map());
    snapshots.add(surface.snapshot());
    snapshots.end();
  });                                                    // snapshots outlive the surface
  using Triangles = std::map<std::size_t, std::size_t>;  // of snapshots, by their numbers
  std::array<Triangles, 2> found;
  const auto ask_each = [&](Triangles& triangles) {
    snapshots.visit_each([&](std::size_t number, const SurfaceSnapshot& snapshot) {
      triangles[number] = snapshot.mesh().triangles.size();
      ask(snapshot);
    });
  };
  std::thread planner(ask_each, std::ref(found[0])), viewer(ask_each, std::ref(found[1]));
  std::thread saver([&] {
    snapshots.visit_each([&](std::size_t /*number*/, const SurfaceSnapshot& snapshot) {
      const SurfaceMesh mesh = snapshot.mesh();
      if (mesh.triangles.empty()) return;
      for (const char* name : {"mesh.ply", "mesh.glb", "mesh.obj"}) save_mesh(mesh, folder.path() / name);
      ++saved;
    });
  });
  for (FrameView frame; source.next(frame);) {
    EXPECT_TRUE(slam.wait_for_room(60'000'000'000));
    queue.show(frame);
    EXPECT_TRUE(slam.push(frame));
  }
  const SlamSummary summary = slam.finish();
  queue.end();
  for (std::thread* thread : {&maker, &planner, &viewer, &saver}) thread->join();
  EXPECT_EQ(summary.tracked, kFrames);
  EXPECT_GT(keyframes, 2);
  EXPECT_GT(saved, 0);
  for (const auto& [number, triangles] : found[0])
    EXPECT_TRUE(!found[1].contains(number) || found[1].at(number) == triangles) << number;
  const SurfaceSnapshot& last = snapshots.last();
  EXPECT_EQ(last.map_version(), slam.map().version());
  const SurfaceMesh mesh = last.mesh();
  EXPECT_GT(mesh.triangles.size(), 500U);
  EXPECT_GT(share_in_blue(mesh), 0.9);
  EXPECT_GT(std::filesystem::file_size(folder.path() / "mesh.ply"), 1000U);
}

}  // namespace
}  // namespace twofold
