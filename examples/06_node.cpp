// A node as robots' middlewares (ROS and others) want it: images come in a callback of theirs, with stamps of
// the time of day; poses go out from a thread of their own, with the stamps of their images.
//   06_node [SOURCE]
// The middleware is played by a source here; class Node is what you take.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

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

class Node {
 public:
  explicit Node(const twofold::CameraRig& rig) : slam_(rig, {.live = true}) {
    slam_.on_pose([this](const twofold::PoseEstimate& pose) { queue_.put(pose); });
    slam_.on_event([this](const twofold::MapEvent& event) { queue_.put(event); });
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
      under_way_.emplace_back(frame.t_ns,
                              stamp_ns);  // before the push: the pose may be there before it returns
    }
    if (const auto pushed = slam_.push(frame); !pushed) std::printf("%s\n", pushed.reason.c_str());
  }

  [[nodiscard]] int published() const { return published_; }

 private:
  void publish_all() {
    twofold::PoseOrEvent item;
    while (queue_.next(item) == twofold::QueueStatus::kItem) {
      if (const std::uint64_t missed = queue_.take_missed(); missed > 0)
        std::printf("publishing is too slow: %llu are missing\n", static_cast<unsigned long long>(missed));
      if (const auto* pose = std::get_if<twofold::PoseEstimate>(&item)) {
        publish(*pose, stamp_of(pose->t_ns));
      } else {
        // The map was corrected: poses jump here, and the transform from map to odometry is to be told anew.
        std::printf("%s\n", to_string(std::get<twofold::MapEvent>(item).kind));
      }
    }
  }

  /// Forgets those before it, which were dropped.
  std::int64_t stamp_of(std::int64_t t_ns) {
    const std::scoped_lock lock(lock_);
    while (!under_way_.empty() && under_way_.front().first < t_ns) under_way_.pop_front();
    return under_way_.empty() ? 0 : under_way_.front().second;
  }

  /// To be replaced by the middleware's: this prints. The world is the camera at the start of its map part: x
  /// right, y down, z forward, no gravity. covariance is relative to reference_keyframe, in the camera's
  /// axes.
  void publish(const twofold::PoseEstimate& pose, std::int64_t stamp_ns) {
    if (pose.state != twofold::TrackingState::kTracked) return;
    ++published_;
    const double variance =
        pose.covariance_known ? pose.covariance[0] : -1;  // -1: ROS has it for "not known"
    std::printf("%lld.%09lld  forward %7.3f m, left %7.3f m, up %7.3f m  (variance %.2g m^2)\n",
                static_cast<long long>(stamp_ns / 1'000'000'000),
                static_cast<long long>(stamp_ns % 1'000'000'000), pose.T_world_camera.t[2],
                -pose.T_world_camera.t[0], -pose.T_world_camera.t[1], variance);
  }

  std::mutex lock_;                                              // guards under_way_
  std::deque<std::pair<std::int64_t, std::int64_t>> under_way_;  // time of the frame, stamp of its message
  std::atomic<int> published_{0};
  twofold::PoseQueue queue_;
  twofold::Slam slam_;
  std::jthread publisher_;  // last: it ends before what it uses
};

int run(const char* name) {
  twofold::Source source(name, {.preload = true});
  int published = 0;
  {
    Node node(source.rig());
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
