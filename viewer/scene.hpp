#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "twofold/estimate.hpp"
#include "twofold/map.hpp"
#include "twofold/queue_lengths.hpp"
#include "viewer/change_set.hpp"
#include "viewer/surface_layer.hpp"
#include "viewer/wire_format.hpp"

namespace twofold {

// Whether the change is worth telling: a hair's breadth is not, or each round of the mapper would tell all
// points again.
[[nodiscard]] bool differs(const ViewPoint& shown, const ViewPoint& now);
[[nodiscard]] bool differs(const ViewKeyframe& shown, const ViewKeyframe& now);
[[nodiscard]] bool differs(const ViewEdge& shown, const ViewEdge& now);

/// A map as the page gets it; each list ascending by key.
struct ViewMap {
  std::uint64_t version = 0;
  std::vector<ViewPoint> points;
  std::vector<ViewKeyframe> keyframes;
  std::vector<ViewEdge> edges;
};

/// Marks the edges that close loops, and adds those that the map does not have. Where a loop's keyframe is
/// gone, the one before it stands for it.
void mark_loops(const std::vector<MapSnapshot::Loop>& loops, ViewMap& view);

/// Times of `t_ns` are counted from `start_ns`. O(size of the map); covariances take four times as long as
/// the rest.
[[nodiscard]] ViewMap view_of(const MapSnapshot& map, std::int64_t start_ns, bool with_covariance);

/// Codes of the points' standard deviations by their ids; 0: not known. They are found by and by, as they
/// take so much longer than the rest.
class PointDeviations {
 public:
  /// All of them anew.
  void find(const MapSnapshot& map);
  /// What was found is put into points that have none.
  void put_into(std::vector<ViewPoint>& points) const;

 private:
  std::vector<std::uint8_t> codes_;
};

[[nodiscard]] std::vector<ViewKeyframe> keyframes_of(const MapSnapshot& map, std::int64_t start_ns);

/// Code of ViewPoint::deviation.
[[nodiscard]] std::uint8_t deviation_code(double deviation);

/// Where the camera truly was, in the world of a map part.
struct ViewTruth {
  std::uint32_t part = 0;
  double scale = 1;                        ///< its lengths as they are shown over the true ones
  std::vector<std::array<float, 4>> path;  ///< t [s], x, y, z [m]
};

/// Something that happened, for the time line.
struct ViewEvent {
  std::string kind;
  std::string text;  ///< a sentence; may be empty
  std::uint32_t frame = 0;
  float t = 0;  ///< [s]
  std::uint32_t keyframe = kNoId;
  std::uint32_t part_before = kNoId;
  std::uint32_t part = kNoId;
  double moved = 0;                         ///< [m]
  double turned = 0;                        ///< [rad]
  std::array<double, 3> before{}, after{};  ///< the camera's positions [m]
  /// Of loops: `keyframe` came back to what the map has there; `moved` and `turned` are by how much the map
  /// was wrong.
  std::optional<MapSnapshot::Loop> loop = {};
  /// Of corrections of a map whose unit is arbitrary: lengths around the camera now over lengths before.
  std::optional<double> scale = {};
};

/// Frames of a live run that were not tracked, so far; -1: not known.
struct ViewLosses {
  std::int64_t dropped = -1;  ///< they came, and another one took their turn or their buffer
  std::int64_t lost = -1;     ///< they never came: the camera or its driver lost them
};

/// Sets `in_reference` and `turned`.
void set_pose_in_reference(const Pose& T_reference_camera, ViewPathFrame& frame);

/// Everything that is shown: the map, the path, the newest frames, events; as deltas between revisions.
///
/// One thread. Memory: the map, at most kMaxPath frames (all of the newest; of older ones every 2nd, 4th, 8th
/// ..., evenly), and the newest frames and events.
class ViewScene {
 public:
  static constexpr std::size_t kMaxPath = 1U << 15;  // what a picture of it can show
  static constexpr std::size_t kLiveFrames = 512;
  static constexpr std::size_t kMaxEvents = 4096;
  static constexpr std::uint32_t kMostDropped = 64;

  /// Frames that were dropped since the last call are put before this one on the path, the newest
  /// kMostDropped of them.
  void add(const PoseEstimate& pose, std::span<const std::int64_t> stage_ns, const QueueLengths& waiting = {},
           const ViewLosses& losses = {});
  void add(const MapEvent& event);
  /// Corrections wait from here on for the map that they tell of, which says how far they changed its scale:
  /// of maps whose unit is arbitrary.
  void find_scales() { find_scales_ = true; }
  /// Events that wait for a map of this version or an older one need not wait any longer.
  void release_events(std::uint64_t version);
  void add(ViewEvent event);
  /// Loops of a map that were not told yet become events. Those of one map begin as those of the one before.
  void add_loops(const std::vector<MapSnapshot::Loop>& loops);
  void add(const ViewPathFrame& frame);
  /// Replaces what was told of it before.
  void set_truth(ViewTruth truth) {
    truth_ = std::move(truth);
    ++truths_;
  }
  [[nodiscard]] const SurfaceLayer& surface() const { return surface_; }
  [[nodiscard]] SurfaceLayer& surface() { return surface_; }
  /// No keyframe is made, until it is told otherwise.
  void set_mapping_paused(bool paused) {
    states_ += paused != mapping_paused_ ? 1 : 0;
    mapping_paused_ = paused;
  }
  /// The map is now this.
  void show(const ViewMap& map);
  /// Its keyframes alone, which the path hangs on.
  void show_keyframes(const std::vector<ViewKeyframe>& keyframes, std::uint64_t version = 0);

  [[nodiscard]] Revision revision() const { return revision_; }
  [[nodiscard]] std::uint64_t map_version() const { return map_version_; }
  /// Messages that lead from a revision to the present one, each of about kMessageBytes at most. Not for
  /// since = revision(). Those who ask for the same get the same ones.
  using Delta = std::vector<std::shared_ptr<const std::string>>;
  static constexpr std::size_t kMessageBytes = 256U << 10;
  [[nodiscard]] std::shared_ptr<const Delta> delta(Revision since) const;

  /// Live frames are numbered as they come; those before first_live() are forgotten.
  [[nodiscard]] std::uint64_t first_live() const { return end_live_ - live_.size(); }
  [[nodiscard]] std::uint64_t end_live() const { return end_live_; }
  [[nodiscard]] const ViewLiveFrame& live(std::uint64_t number) const { return live_[number - first_live()]; }

  /// Likewise.
  [[nodiscard]] std::uint64_t first_event() const { return end_event_ - events_.size(); }
  [[nodiscard]] std::uint64_t end_event() const { return end_event_; }
  [[nodiscard]] const ViewEvent& event(std::uint64_t number) const { return events_[number - first_event()]; }

  /// Number of a reason in reasons(), which grows when it is new; 0 when there are too many.
  [[nodiscard]] std::uint8_t reason_number(const char* reason);
  [[nodiscard]] const std::optional<ViewTruth>& truth() const { return truth_; }
  /// How often it was set.
  [[nodiscard]] std::uint32_t truths() const { return truths_; }
  [[nodiscard]] bool mapping_paused() const { return mapping_paused_; }
  /// How often the state changed, counted from 1: nobody knows the first.
  [[nodiscard]] std::uint32_t states() const { return states_; }
  [[nodiscard]] const std::vector<std::string>& reasons() const { return reasons_; }
  /// Time stamp of the scene's first moment: that of the first pose or event, or what it was told to be.
  [[nodiscard]] std::optional<std::int64_t> start_ns() const { return start_ns_; }
  void begin(std::int64_t t_ns) {
    if (!start_ns_) start_ns_ = t_ns;
  }
  [[nodiscard]] std::size_t keyframe_count() const { return keyframes_.size(); }
  [[nodiscard]] std::size_t point_count() const { return points_.size(); }

 private:
  [[nodiscard]] float seconds(std::int64_t t_ns) const {
    return static_cast<float>(1e-9 * static_cast<double>(t_ns - *start_ns_));
  }
  void add_dropped(const ViewLiveFrame& next);
  /// Leaves out older frames of a path that has become too long.
  void thin_path();
  /// Those that the map of this version, which has these keyframes, was waited for by.
  void find_scales(const std::vector<ViewKeyframe>& next, std::uint64_t version);
  /// Hangs frames of the path on keyframes that stay.
  void rebind_path(const std::vector<ViewKeyframe>& next, Revision revision);
  [[nodiscard]] std::shared_ptr<const Delta> encode(Revision since) const;

  Revision revision_ = 0;
  std::uint64_t map_version_ = 0;
  ChangeSet<ViewPoint> points_;
  ChangeSet<ViewKeyframe> keyframes_;
  ChangeSet<ViewEdge> edges_;
  ChangeSet<ViewPathFrame> path_;
  std::size_t thinned_ = 0;  // first frames of path_, of which every path_stride_-th was kept
  std::size_t path_stride_ = 2;
  std::uint32_t end_frame_ = 0;  // one more than the number of the last frame of the path
  float end_t_ = 0;              // its time
  std::uint32_t dropped_ = 0;    // frames, so far
  std::deque<ViewLiveFrame> live_;
  std::deque<ViewEvent> events_;
  std::uint64_t end_live_ = 0, end_event_ = 0;
  struct WaitingEvent {
    ViewEvent event;
    std::uint64_t version = 0;  // of the map that it tells of
  };
  std::deque<WaitingEvent> waiting_events_;
  bool find_scales_ = false;
  std::size_t loops_ = 0;  // told
  std::vector<std::string> reasons_{""};
  std::optional<std::int64_t> start_ns_;
  std::optional<ViewTruth> truth_;
  std::uint32_t truths_ = 0;
  SurfaceLayer surface_;
  bool mapping_paused_ = false;
  std::uint32_t states_ = 1;
  struct Encoded {
    Revision since = 0, to = 0;
    std::weak_ptr<const Delta> delta;
  };
  mutable std::vector<Encoded> encoded_;  // those that somebody is still sending
};

}  // namespace twofold
