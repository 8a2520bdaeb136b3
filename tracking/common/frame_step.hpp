#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include "camera/frame.hpp"
#include "camera/rolling_shutter.hpp"
#include "graph/keyframe_proposal.hpp"
#include "graph/snapshot.hpp"
#include "tracking/common/effort.hpp"
#include "tracking/common/placement.hpp"
#include "tracking/common/track_result.hpp"

namespace twofold {

/// Where the search for one frame's pose begins.
struct SearchStart {
  enum class Kind : std::uint8_t {
    kNear,       ///< aligned to the last good frame, or where it would be had it gone on as it moved
    kRough,      ///< by appearance, by depth alignment alone, or by going on through several lost frames: far
                 ///< points are found from there, and lead to where near ones are
    kRecognised  ///< likewise, where the loop closer recognised the camera: it may be anywhere
  };
  Placement placement;
  Kind kind = Kind::kNear;

  [[nodiscard]] bool rough() const { return kind != Kind::kNear; }
};

/// What one attempt at a frame's pose came to; what another one overwrites, so that it can be set aside while
/// that is made.
struct Attempt {
  TrackResult result;
  RollingShutter shutter;  ///< as the camera moves in this frame, as far as known
  /// How it moves in this frame, left perturbation a second, where a start found that out: there is no frame
  /// before.
  std::optional<Vector6> velocity;
  /// Information of a pose that depth alignment gave if each plane erred by itself, as the weights of edges
  /// assume of points.
  Matrix6 information_of_planes = Matrix6::Zero();
};

/// What belongs to one frame only: handed from stage to stage of the tracker, which writes the result.
class FrameStep : public Attempt {
 public:
  FrameStep(const Frame& new_frame, const GraphSnapshot& map, KeyframeProposal* buffer,
            const EffortBounds& limits, int frames_without_pose)
      : frame(new_frame),
        graph(map),
        free_proposal(buffer),
        bounds(limits),
        lost_frames(frames_without_pose) {}

  const Frame& frame;
  const GraphSnapshot& graph;
  KeyframeProposal* const free_proposal;  ///< null: no keyframe can be made
  const EffortBounds bounds;
  const int lost_frames;       ///< between the last one with a pose and this one
  bool depth_read = false;     ///< the frame's depth image, by the depth alignment
  bool depth_refused = false;  ///< the pose that it gave, for what the points found say of it
  bool tracked = false;        ///< in the map that there was
  bool started = false;        ///< a map or map part, with this frame
  /// Of a start by motion: frames before this one whose poses its start found out, relative to the reference
  /// keyframe.
  std::vector<EarlierFrame> earlier_frames;

  /// The frame before this one has no pose.
  [[nodiscard]] bool after_loss() const { return lost_frames > 0; }
  /// Attributes the time since the last lap to a stage.
  void lap(TrackerStage stage) {
    const auto now = std::chrono::steady_clock::now();
    result.stage_ns[static_cast<std::size_t>(stage)] += (now - last_lap_).count();
    last_lap_ = now;
  }
  /// What the frame's pose came to so far.
  [[nodiscard]] Attempt attempt() const { return *this; }
  /// All is again what it was, but for the time that passed.
  void restore(const Attempt& earlier) {
    const auto stage_ns = result.stage_ns;
    static_cast<Attempt&>(*this) = earlier;
    result.stage_ns = stage_ns;
  }
  /// The time since the last lap was not the tracker's.
  void resume() { last_lap_ = std::chrono::steady_clock::now(); }

 private:
  std::chrono::steady_clock::time_point last_lap_ = std::chrono::steady_clock::now();
};

}  // namespace twofold
