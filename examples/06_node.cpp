// A node as robots' middlewares (ROS and others) want it: images come in a callback of theirs, with stamps of
// the time of day; poses go out from a thread of their own, with the stamps of their images, in the axes and
// frames of REP 103 and REP 105; what goes wrong is said while it runs.
//   06_node [SOURCE]
// The middleware is played by a source here; class Node is what you take.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <deque>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <twofold/pose_queue.hpp>
#include <twofold/slam.hpp>
#include <twofold/source.hpp>

namespace {

std::int64_t time_of_day_ns() {
  return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
}
std::int64_t monotonic_ns() {  // CLOCK_MONOTONIC, which Slam's live runs are timed by
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// From a camera's axes (x right, y down, z forward) to a robot's (x forward, y left, z up; REP 103).
const twofold::Pose kRobotCamera{{-0.5, 0.5, -0.5, 0.5}, {0, 0, 0}};

/// A motion between frames of camera axes as one between frames of robot axes.
twofold::Pose in_robot_axes(const twofold::Pose& T) {
  return compose(kRobotCamera, compose(T, inverse(kRobotCamera)));
}

using Covariance = std::array<double, 36>;

/// What ROS wants in a PoseWithCovariance: of (x, y, z, rotations about x, y, z) along the axes of the frame
/// that the pose is in. Twofold's is of (translation, rotation) along the camera's.
/// @param T  of the camera in that frame
Covariance along_axes_of_parent(const Covariance& camera, const twofold::Pose& T) {
  const twofold::Pose R{T.q, {0, 0, 0}};
  std::array<std::array<double, 3>, 3> column{};  // of the rotation matrix
  for (std::size_t i = 0; i < 3; ++i) {
    std::array<double, 3> axis{};
    axis[i] = 1;
    column[i] = transform(R, axis);
  }
  Covariance parent{};
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = 0; j < 6; ++j)
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t l = 0; l < 3; ++l)
          parent[6 * i + j] +=
              column[k][i % 3] * camera[6 * (i / 3 * 3 + k) + j / 3 * 3 + l] * column[l][j % 3];
  return parent;
}

class Node {
 public:
  /// @param T_rectified_raw  of the source, or of the FrameRectifier that made the images: what is published
  ///                         is the pose of the lens as it was calibrated, which a robot's extrinsics are of
  Node(const twofold::CameraRig& rig, const twofold::Pose& T_rectified_raw)
      : T_rectified_raw_(T_rectified_raw), slam_(rig, {.live = true}) {
    slam_.on_pose([this](const twofold::PoseEstimate& pose) { queue_.put(pose); });
    publisher_ = std::jthread([this] { publish_all(); });
  }
  ~Node() {
    (void)slam_.finish();  // first: until then the queue is filled
    queue_.close();        // what is in it still goes out
  }

  /// The middleware's thread. `frame` has the stamp of its clock, and an owner that holds the message.
  void on_images(twofold::FrameView frame) {
    const std::int64_t stamp_ns = frame.t_ns, age_ns = time_of_day_ns() - stamp_ns;
    constexpr std::int64_t kStale = 200'000'000;
    if (age_ns > kStale) {  // it hung in the network: tracking it would make the newer ones late, too
      std::printf("images of %.2f s ago are left out\n", static_cast<double>(age_ns) * 1e-9);
      return;
    }
    // What is as old on both clocks is the same moment. When somebody sets the time of day this still holds
    // for new images.
    frame.t_ns = monotonic_ns() - age_ns;
    {
      const std::scoped_lock lock(lock_);
      // Before the push: the pose may be there before it returns.
      under_way_.emplace_back(frame.t_ns, stamp_ns);
    }
    if (const auto pushed = slam_.push(frame); !pushed) std::printf("%s\n", pushed.reason.c_str());
  }

  [[nodiscard]] int published() const { return published_; }

 private:
  void publish_all() {
    constexpr std::int64_t kLookForErrors = 500'000'000;
    twofold::PoseOrEvent item;
    for (;;) {
      const twofold::QueueStatus status = queue_.next(item, kLookForErrors);
      if (status == twofold::QueueStatus::kEnd) return;
      say_errors();
      if (status != twofold::QueueStatus::kItem) continue;  // no frame came for a while
      if (const std::uint64_t missed = queue_.take_missed(); missed > 0)
        std::printf("publishing is too slow: %llu are missing\n", static_cast<unsigned long long>(missed));
      if (const auto* pose = std::get_if<twofold::PoseEstimate>(&item)) publish(*pose, stamp_of(pose->t_ns));
    }
  }

  /// A thread of the engine that ended, a disk that is full: tracking may be over, or its records incomplete.
  /// A node's diagnostics. Each new one once.
  void say_errors() {
    std::vector<std::string> errors = slam_.errors();
    for (const std::string& error : errors)
      if (std::find(errors_.begin(), errors_.end(), error) == errors_.end())
        std::printf("error: %s\n", error.c_str());
    errors_ = std::move(errors);
  }

  /// Forgets those before it, which were dropped.
  std::int64_t stamp_of(std::int64_t t_ns) {
    const std::scoped_lock lock(lock_);
    while (!under_way_.empty() && under_way_.front().first < t_ns) under_way_.pop_front();
    return under_way_.empty() ? 0 : under_way_.front().second;
  }

  /// When the map is corrected the camera's pose jumps in it. In odom it must not (REP 105), so that the
  /// transform from map to odom jumps instead. A node sends that with each pose; this prints it when it has
  /// moved by a centimetre.
  void tell_transform(const twofold::PoseEstimate& pose) {
    const twofold::Pose T_map_odom = in_robot_axes(compose(pose.T_world_camera, inverse(pose.T_odom_camera)));
    const twofold::Pose moved = compose(inverse(T_map_odom_), T_map_odom);
    constexpr double kTold = 0.01;
    if (pose.map_part == map_part_ && std::hypot(moved.t[0], moved.t[1], moved.t[2]) < kTold) return;
    std::printf("map_%u -> odom  %.3f %.3f %.3f\n", pose.map_part, T_map_odom.t[0], T_map_odom.t[1],
                T_map_odom.t[2]);
    T_map_odom_ = T_map_odom;
    map_part_ = pose.map_part;
  }

  /// To be replaced by the middleware's: this prints. odom begins as the camera at its first pose, no
  /// gravity: x is where it looked then. Map parts have worlds of their own: each is a map frame of its own,
  /// "map_" and its part.
  void publish(const twofold::PoseEstimate& pose, std::int64_t stamp_ns) {
    if (pose.state != twofold::TrackingState::kTracked) return;
    ++published_;
    tell_transform(pose);
    const twofold::Pose T_odom_raw = in_robot_axes(compose(pose.T_odom_camera, T_rectified_raw_));
    // Of the pose relative to reference_keyframe. Drift is not in it: a filter that fuses this with other
    // odometry should take differences of poses (robot_localization: `differential`).
    const Covariance covariance =
        along_axes_of_parent(pose.covariance, compose(kRobotCamera, pose.T_odom_camera));
    std::printf("%lld.%09lld  map_%u odom  x %7.3f m, y %7.3f m, z %7.3f m",
                static_cast<long long>(stamp_ns / 1'000'000'000),
                static_cast<long long>(stamp_ns % 1'000'000'000), map_part_, T_odom_raw.t[0], T_odom_raw.t[1],
                T_odom_raw.t[2]);
    if (pose.covariance_known) {
      std::printf("  (sigma %.1g %.1g %.1g m)\n", std::sqrt(covariance[0]), std::sqrt(covariance[7]),
                  std::sqrt(covariance[14]));
    } else {
      std::printf("  (sigma unknown)\n");  // ROS has -1 in the first element for that
    }
  }

  std::mutex lock_;                                              // guards under_way_
  std::deque<std::pair<std::int64_t, std::int64_t>> under_way_;  // time of the frame, stamp of its message
  std::atomic<int> published_{0};
  const twofold::Pose T_rectified_raw_;
  // The publisher's: as it was told last, in the robot's axes.
  twofold::Pose T_map_odom_;
  std::uint32_t map_part_ = twofold::kNoId;
  std::vector<std::string> errors_;
  twofold::PoseQueue queue_;
  twofold::Slam slam_;
  std::jthread publisher_;  // last: it ends before what it uses
};

int run(const char* name) {
  twofold::Source source(name, {.preload = true});
  int published = 0;
  {
    Node node(source.rig(), source.T_rectified_raw());
    auto due = std::chrono::steady_clock::now();
    for (twofold::FrameView frame; source.next(frame); due += std::chrono::microseconds(33'333)) {
      std::this_thread::sleep_until(due);
      frame.t_ns = time_of_day_ns();
      node.on_images(frame);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));  // a node runs on
    published = node.published();
  }
  return published > 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) try {
  return run(argc > 1 ? argv[1] : "synthetic:courtyard?frames=150");
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
