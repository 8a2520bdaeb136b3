// A surface that is made, asked about and saved by threads of the user's while a run reads, tracks and maps;
// run by scripts/test_sanitized tsan, too.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <filesystem>
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

/// The newest snapshot, and what those who asked about each have found.
class NewestSnapshot {
 public:
  void put(SurfaceSnapshot snapshot) {
    const std::scoped_lock lock(mutex_);
    snapshot_ = std::move(snapshot);
    ++number_;
  }
  [[nodiscard]] std::pair<int, SurfaceSnapshot> get() const {
    const std::scoped_lock lock(mutex_);
    return {number_, snapshot_};
  }
  /// Each that is the newest when the one before was visited, to the last.
  template <class Visit>
  void visit_each(const std::atomic<bool>& no_more, const Visit& visit) const {
    for (int last = 0;;) {
      const bool ends = no_more;
      const auto [number, snapshot] = get();
      if (number != last) {
        visit(number, snapshot);
      } else if (ends) {
        return;
      } else {
        std::this_thread::yield();
      }
      last = number;
    }
  }
  /// False where another thread found another number of triangles in the same snapshot.
  bool found(int number, std::size_t triangles) {
    const std::scoped_lock lock(mutex_);
    return triangles_.try_emplace(number, triangles).first->second == triangles;
  }

 private:
  mutable std::mutex mutex_;  // guards all
  SurfaceSnapshot snapshot_;
  int number_ = 0;
  std::map<int, std::size_t> triangles_;
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

/// Where the camera was, and a box before it.
void ask(const SurfaceSnapshot& snapshot, const Pose& T_world_camera) {
  const std::array<double, 3> before = transform(T_world_camera, {0, 0, 1});
  (void)snapshot.at(before);
  const DistanceBox box{{before[0] - 0.3, before[1] - 0.3, before[2] - 0.3},
                        {before[0] + 0.3, before[1] + 0.3, before[2] + 0.3},
                        0.1,
                        0.3};
  (void)snapshot.distances(box).at(before);
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
  NewestSnapshot newest;
  std::atomic<bool> done{false};
  std::atomic<int> asked{0}, saved{0}, contradictions{0}, keyframes{0};
  slam.on_pose([&](const PoseEstimate& pose) { queue.decide(pose); });
  std::thread maker([&] {
    MapSurface surface(slam.map(), {.model = {.voxel_size = 0.05}});
    while (auto keyframe = queue.take()) {
      surface.add(source.in_colour(keyframe->second), keyframe->first);  // read again beside the reader
      surface.update(slam.map());
      newest.put(surface.snapshot());
      ++keyframes;
    }
    surface.update(slam.map());
    newest.put(surface.snapshot());
  });  // snapshots outlive the surface
  const auto ask_each = [&] {
    newest.visit_each(done, [&](int number, const SurfaceSnapshot& snapshot) {
      const std::size_t triangles = snapshot.mesh().triangles.size();
      if (const auto pose = slam.latest()) ask(snapshot, pose->T_world_camera);
      contradictions += newest.found(number, triangles) ? 0 : 1;
      asked += triangles > 0 ? 1 : 0;
    });
  };
  std::thread planner(ask_each), viewer(ask_each);
  std::thread saver([&] {
    newest.visit_each(done, [&](int /*number*/, const SurfaceSnapshot& snapshot) {
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
  maker.join();
  done = true;
  for (std::thread* thread : {&planner, &viewer, &saver}) thread->join();
  EXPECT_EQ(summary.tracked, kFrames);
  EXPECT_GT(keyframes, 2);
  EXPECT_GT(asked, 1);
  EXPECT_GT(saved, 0);
  EXPECT_EQ(contradictions, 0);
  const SurfaceSnapshot last = newest.get().second;
  EXPECT_EQ(last.map_version(), slam.map().version());
  const SurfaceMesh mesh = last.mesh();
  EXPECT_GT(mesh.triangles.size(), 500U);
  EXPECT_GT(share_in_blue(mesh), 0.9);
  EXPECT_GT(std::filesystem::file_size(folder.path() / "mesh.ply"), 1000U);
}

}  // namespace
}  // namespace twofold
