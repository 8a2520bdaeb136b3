#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "fixtures/plain_map.hpp"
#include "fixtures/rendered_scene.hpp"
#include "tests/allocation_counter.hpp"
#include "tracking/tracker.hpp"

namespace twofold::testing {

inline constexpr int kFrames = 40;

/// Along a gentle curve, looking about.
inline SE3 T_c_w_at(int i) {
  const double s = 0.03 * i;
  const SE3 T_w_c(SO3::exp(Vector3(0.05 * std::sin(3 * s), 0.25 * std::sin(1.5 * s), 0.04 * std::sin(4 * s))),
                  Vector3(0.5 * std::sin(s), 0.1 * std::sin(2 * s), s));
  return T_w_c.inverse();
}

/// Rendered once for all tests of a sensor.
inline const std::vector<Frame>& frames(SensorKind kind) {
  static std::array<std::vector<Frame>, 3> all;
  std::vector<Frame>& result = all[static_cast<std::size_t>(kind)];
  if (!result.empty()) return result;
  RenderedScene scene(test_rig(kind, 320, 240), {3, 2, 5}, 21);
  for (int i = 0; i < kFrames; ++i) {
    FrameImages images;
    scene.render(T_c_w_at(i) * T_c_w_at(0).inverse(), 2, images);
    Frame frame{i, i * std::int64_t{33'000'000}, images.left.level(0).clone(), {}, images.depth.clone()};
    if (kind == SensorKind::kStereo) frame.right = images.right.level(0).clone();
    result.push_back(frame);
  }
  return result;
}

inline SE3 true_T_c_w(int i) {
  return T_c_w_at(i) * T_c_w_at(0).inverse();
}

/// Tracker and map in lockstep.
class Odometry {
 public:
  explicit Odometry(SensorKind kind) : Odometry(test_rig(kind, 320, 240)) {}
  explicit Odometry(const Rig& rig, const TrackerOptions& options = {}) : tracker_(rig, options) {
    tracker_.prepare(proposal_);
  }

  TrackResult step(const Frame& frame) {
    if (pending_) map_.insert(proposal_);
    if (pending_) snapshot_ = map_.publish();
    pending_ = false;
    const std::uint64_t before = testing::allocations();  // not the member of that name
    const TrackResult result = tracker_.step(frame, snapshot_, &proposal_, effort_);
    allocations_ = testing::allocations() - before;
    pending_ = result.proposed;
    return result;
  }
  /// The last result's pose in the world.
  [[nodiscard]] SE3 T_c_w(const TrackResult& result) const {
    if (snapshot_.contains(result.reference)) return result.T_c_ref * snapshot_.T_k_w(result.reference);
    return result.T_c_ref;  // the first keyframe is the world
  }
  Tracker& tracker() { return tracker_; }
  void set_effort(EffortLevel effort) { effort_ = effort; }
  [[nodiscard]] const GraphSnapshot& snapshot() const { return snapshot_; }
  [[nodiscard]] const KeyframeProposal& proposal() const { return proposal_; }
  [[nodiscard]] std::uint64_t allocations() const { return allocations_; }  ///< of the tracker, last step

 private:
  Tracker tracker_;
  PlainMap map_;
  GraphSnapshot snapshot_ = map_.publish();
  KeyframeProposal proposal_;
  bool pending_ = false;
  EffortLevel effort_ = EffortLevel::kEverything;
  std::uint64_t allocations_ = 0;
};

inline Frame covered(const Frame& frame) {
  Frame dark = frame;
  dark.left = cv::Mat(frame.left.rows, frame.left.cols, CV_8UC1, cv::Scalar(3));
  dark.right = dark.left.clone();
  return dark;
}

}  // namespace twofold::testing
