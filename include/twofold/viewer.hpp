#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "twofold/estimate.hpp"
#include "twofold/frame_details.hpp"
#include "twofold/map.hpp"
#include "twofold/queue_lengths.hpp"
#include "twofold/surface.hpp"
#include "twofold/types.hpp"

namespace twofold {

/// What those who look may ask for, if ViewerOptions::on_command lets them.
enum class ViewCommand : std::uint8_t {
  kSaveMap,
  kStop,          ///< the run
  kPauseMapping,  ///< localise only: no more keyframes
  kResumeMapping
};

/// An image, and what keeps its pixels alive; without pixels: none.
struct ViewedImage {
  ImageView pixels = {};
  std::shared_ptr<const void> owner = nullptr;
};

struct ViewerOptions {
  std::string title = {};  ///< shown in the page
  /// Address to listen on. Any but a loopback address shows camera and map to the network, unencrypted: from
  /// another machine, `ssh -L 8420:localhost:8420 ROBOT` is the better way.
  std::string bind = "127.0.0.1";
  int port = 8420;  ///< 0: any that is free
  /// Keeps what lets people in, so that the address stays the same when the program is started anew, and open
  /// pages come back by themselves: made, for its owner alone, when it is not there. A file that others may
  /// read is refused. Empty: a new address each time.
  std::filesystem::path secrets = {};
  std::vector<std::string> stages = {};   ///< names of what `tell` is given times of, at most 8
  std::vector<std::string> efforts = {};  ///< words of PoseEstimate::effort, from 0 on; may be none
  double frame_period = 0;                ///< a frame's budget [s], finite, >= 0; 0: as the frames' times say
  /// Whose pace the run keeps, "camera" or "recording": the page says how far poses are behind it. Empty: no
  /// pace; PoseEstimate::latency_ns is then what tracking took.
  std::string paced_by = {};
  std::vector<Pose> truth = {};  ///< T_world_camera of the true path, if it is known, in any world
  std::vector<std::int64_t> truth_t_ns = {};  ///< its times, ascending, as many; else nothing is shown
  /// Whether lengths are metres; else the map has a unit of its own: the page writes lengths without one,
  /// says by how much corrections changed the scale, and lays the true path scaled upon the tracked one.
  /// Nothing: as the rig says, false for Sensor::kMono.
  std::optional<bool> metric = {};
  /// Does what a viewer asks for, on the viewer's thread, and says in a sentence what it did; what it throws
  /// is told as a failure. Empty: viewers can only look.
  std::function<std::string(ViewCommand)> on_command = {};
  /// The left image of the frame with that time stamp, grey or colour, for those who click its keyframe:
  /// asked on the viewer's thread, four times a second at most. What it throws means that there is none.
  /// Empty: no keyframe has one.
  std::function<ViewedImage(std::int64_t t_ns)> recorded_image = {};

  /// Empty when valid; otherwise names the field, the rule and, where it is a number, the value.
  [[nodiscard]] TWOFOLD_API std::string invalid_reason() const;
};

/// Shows a run in a browser while it runs: map, windows, path, events, times (docs/viewer.md).
///
///   Slam slam(rig, {});
///   Viewer viewer(rig, [&] { return slam.map(); },
///                 {.title = "my robot", .stages = tracker_stages(), .efforts = effort_levels()});
///   slam.on_frame([&](const PoseEstimate& p, const FrameDetails& details) { viewer.tell(p, details); });
///   slam.on_event([&](const MapEvent& event) { viewer.tell(event); });
///   std::puts(viewer.address().c_str());
///   ...
///   slam.finish();  // before the viewer is gone, whatever is thrown: until then it is called
///
/// A thread of its own, of the lowest priority, does everything; nobody waits for it or for who looks.
/// Component `viewer` of the package: find_package(Twofold COMPONENTS viewer), Twofold::viewer.
///
/// Threads:
/// - address, addresses, port, is_open_to_network: any, always.
/// - tell of poses, of MapEvents and of points, wants_points: one and the same for all of them, the
///   tracker's, which calls Slam::on_frame and Slam::on_event: who tells events from another thread than
///   poses has a data race. A copy into a ring: no lock, no allocation, no system call. A viewer that falls
///   behind by the whole ring (1024 frames) leaves frames out.
/// - tell_waiting, tell_lost: any, one at a time each.
/// - show, wants_image: one, that of the images' source; it may be the tracker's.
/// - show_surface: any; waits for the viewer's thread while that takes pieces over: not for the tracker's.
/// - finish, and the destructor, which finishes: any but the viewer's own, when no other thread is in one of
///   the above any more.
/// - map, on_command, recorded_image are called by the viewer's, one at a time; while they take, nobody is
///   served. What they throw becomes an event.
/// After finish, tell and show do nothing that anybody sees.
class TWOFOLD_API Viewer {
 public:
  /// @param map  asked for the newest map now and then, by the viewer's thread; may be empty
  /// Throws std::invalid_argument naming the option that makes no sense, std::runtime_error when the port is
  /// not to be had, or the library was built without the page.
  Viewer(const CameraRig& rig, std::function<MapSnapshot()> map, const ViewerOptions& options = {});
  /// Finishes.
  ~Viewer();
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  /// With its token: who knows it may look.
  [[nodiscard]] std::string address() const;
  /// Where it listens at all addresses of the machine (bind = "0.0.0.0"): each by which others reach it,
  /// its name in the local network, and http://127.0.0.1 last; else the one.
  [[nodiscard]] std::vector<std::string> addresses() const;
  [[nodiscard]] int port() const;
  [[nodiscard]] bool is_open_to_network() const;

  /// Of Slam::on_frame: the pose, what the frame took and what waits; and what was measured, if the frame's
  /// image is shown. Poses come in the order of their frames. Numbers that are left out between two of them
  /// are shown as frames that were dropped (PoseEstimate::frame counts those, too).
  void tell(const PoseEstimate& pose, const FrameDetails& details);
  /// The same of other engines.
  /// @param stage_ns  what its stages took, in the order of ViewerOptions::stages
  void tell(const PoseEstimate& pose, std::span<const std::int64_t> stage_ns = {});
  void tell(const MapEvent& event);
  /// Whether points of this frame would be shown: its image was.
  [[nodiscard]] bool wants_points(std::int64_t frame) const;
  /// The frame's measurements, before its pose is told; the first 512.
  void tell(std::int64_t frame, std::span<const MeasuredPoint> points);

  /// What waits for the engine's threads; until it is told, it is not known.
  void tell_waiting(const QueueLengths& waiting);
  /// Frames that never came because the camera or its driver lost them, since the run began; until it is
  /// told, it is not known.
  void tell_lost(std::int64_t frames);

  /// Whether an image would be shown if it came now: at most five a second are, while somebody looks.
  [[nodiscard]] bool wants_image() const;
  /// @param frame  PoseEstimate::frame, as PushResult says
  /// @param left   grey or colour, else it is not shown
  /// @param owner  keeps its pixels alive and unchanged until the viewer is done with them, and is let go of
  ///               on this thread or the viewer's; null: they are copied
  void show(std::int64_t frame, const ImageView& left, std::shared_ptr<const void> owner);

  /// Pieces of a mesh, in the world of a map part; a mesh of another part, or of cells of another size,
  /// replaces what was shown. At most about 256 MB of it are; a piece of more than 65,535 vertices is not.
  /// @param cell_size  edge of a cell, in the map's unit
  void show_surface(std::uint32_t part, double cell_size, std::vector<SurfacePiece> pieces);

  /// The run is over, its last map there: viewers get it, and are told. Waits for slow ones at most three
  /// seconds beyond what a callback takes. A second call does nothing. Throws std::logic_error when one of
  /// the viewer's callbacks calls it.
  void finish();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Whether viewers can be made: false when the library was built without Node.js or Boost.
[[nodiscard]] TWOFOLD_API bool has_viewer();

}  // namespace twofold
