#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "twofold/estimate.hpp"
#include "twofold/frame_details.hpp"
#include "twofold/map.hpp"
#include "twofold/types.hpp"

namespace twofold {

enum class RunMode : std::uint8_t {
  kThreaded,       ///< tracker, mapper and loop closer on threads of their own
  kDeterministic,  ///< all within push, on the caller's thread: same frames, same bytes
  /// Likewise, but in the order that the schedule.log of another run tells (SlamOptions::schedule): over the
  /// frames of that run, its bytes.
  kReplay,
  /// The engine has no threads: yours take its steps (Slam::step), when and where you like.
  kStepped
};

/// What RunMode::kStepped leaves to the caller. Each takes what waits for it, and none waits for another one.
enum class SlamStep : std::uint8_t {
  kTrack,      ///< locates the camera in the oldest frame that waits; callbacks are called here
  kMap,        ///< takes in what the tracker proposed, and optimises the double window
  kCloseLoops  ///< looks a lost camera's place up, else compares the oldest new keyframe with all places
};

/// What becomes of a frame whose successor is due, too, when its turn comes.
enum class LateFrames : std::uint8_t {
  kQueue,  ///< it is tracked: every frame is, however late
  /// It is dropped if it has waited for 1.5 frame periods, or the tracker is late though it leaves out all
  /// that it can (docs/architecture.md, effort levels).
  kDrop,
  kNewest  ///< it is dropped: the newest one wins
};

/// Where the camera is in a map made before, as far as somebody knows: at a dock, where it was put down.
struct InitialPose {
  Pose T_world_camera;             ///< of the rectified left camera, as poses are
  std::uint32_t map_part = kNoId;  ///< whose world that is (PoseEstimate::map_part); kNoId: the oldest part's
  double position_sigma = 0.05;    ///< standard deviation of each coordinate [m], in [0, 10]
  double angle_sigma = 0.03;       ///< likewise about each axis [rad], in [0, 1]
};

struct SlamOptions {
  RunMode mode = RunMode::kThreaded;
  /// Frames are pushed when they are taken, and their times are of CLOCK_MONOTONIC: latency counts from
  /// there, and a tracker that is late leaves work out; frames more than 10 s from now are refused.
  /// Otherwise frames are a recording's, and tracked as fast as the map can follow, or at `speed`. Needs
  /// RunMode::kThreaded or kStepped.
  bool live = false;
  /// A recording as if it were live: recorded seconds a second, > 0. The first frame is tracked when it
  /// comes, every other one no earlier than its time after that; latency counts from there, and a tracker
  /// that is late leaves work out. Frames may be pushed ahead of their time, as many as there are buffers;
  /// one that is pushed after it is late, whoever is to blame (SourceSettings::preload decodes beforehand).
  /// 0: no such pace. Needs RunMode::kThreaded, without `live`.
  double speed = 0;
  /// With `live` or `speed`. Nothing: kNewest if `live`, else kQueue.
  std::optional<LateFrames> late = {};

  /// Map to go on with (.tfm); empty: start one. The camera is unplaced until a place of it is recognised,
  /// or, after a second, in a map part of its own.
  std::filesystem::path map = {};
  bool localise_only = false;  ///< poses in `map`, which must be given and does not change
  /// Where in `map` the camera is looked for from the first frame on, beside recognition: there, and then
  /// around there as far as its deviations say, at four poses a frame, in 60 frames at most. It is believed
  /// where as much of the map is found as a recognised place must show; a wrong one costs some milliseconds a
  /// frame, and recognition goes on. Deviations of more than some centimetres and degrees are sampled too
  /// thinly to find much.
  std::optional<InitialPose> initial_pose = {};
  /// Recognise places: closes large loops, finds a lost camera, joins map parts. Needed for `map`.
  bool places = true;
  std::filesystem::path vocabulary = {};  ///< instead of the built-in one
  /// finish ends with a bundle adjustment of the whole map, for one camera, and for a rig that has recognised
  /// a place, of up to 5,000 keyframes: one to two milliseconds each.
  bool global_adjustment = true;

  /// Map file that is written again and again during the run, replaced atomically, by a thread that nobody
  /// waits for (in kDeterministic and kReplay within push): after a crash it has the map of the newest
  /// checkpoint. The last map is yours to save (Slam::save_map). One that fails is tried again, and
  /// Slam::errors says why as long as it does. Empty: none. Not with kStepped: call save_map there.
  std::filesystem::path checkpoint = {};
  /// From one checkpoint to the next [s], in (0, 1e9]; in kDeterministic and kReplay by the frames' times.
  double checkpoint_period = 60;

  /// Of RunMode::kReplay: schedule.log of a run (run_folder), the other options being that run's. One of
  /// another rig, or over other frames, fails with the first push, and errors() says so. Not in the
  /// run_folder of the replay, which would overwrite it.
  std::filesystem::path schedule = {};

  int inner_window = 25;   ///< keyframes optimised with their points, >= 1
  int outer_window = 175;  ///< keyframes around them optimised by relative poses, >= 0
  int frame_buffers = 8;   ///< frames on their way at most, in [2, 65536]; a push beyond them is dropped

  std::optional<int> tracker_cpu = {};  ///< pin the threads to these, >= 0
  std::optional<int> mapper_cpu = {};
  std::optional<int> loop_closer_cpu = {};
  std::optional<int> fifo_priority = {};  ///< SCHED_FIFO for the tracker, 1..99

  /// A folder that exists. trajectory_causal.txt (TUM form) and schedule.log (for `twofold run
  /// --replay-schedule`) grow in it and are whole, but for the last 0.1 s, however the process ends; what is
  /// remembered of each frame goes to its disk, so that memory does not grow with the time: not before
  /// finish, which reads the poses into SlamSummary::poses. What stays in memory for the whole run are
  /// the loops that were closed, some hundred bytes each (MapSnapshot::loops). A disk that is full or too
  /// slow is no reason to stop: Slam::errors says, while it runs, which file lost what. Empty: all in memory.
  std::filesystem::path run_folder = {};
  /// Without a folder: how many of the newest frames have a pose in SlamSummary::poses, >= 1, at 176
  /// bytes each; older ones are forgotten. A million are nine hours at 30 Hz.
  std::int64_t kept_frames = 1'000'000;

  /// File that finish writes: when each thread took which step, how long its queue was and which version of
  /// the map it saw, to be opened in ui.perfetto.dev. The newest 262,144 spans and values a thread, 6 MiB.
  /// Empty: none.
  std::filesystem::path trace = {};

  /// Empty when valid; otherwise names the field, the rule and, where it is a number, the value. Folders that
  /// files are to be written into are looked for.
  [[nodiscard]] TWOFOLD_API std::string invalid_reason() const;
};

enum class PushStatus : std::uint8_t {
  /// On its way to the tracker, or, in a deterministic run or a replay, tracked. With `live` or `speed` a
  /// newer frame may still take its turn (LateFrames): it then counts as dropped, and nobody is called.
  kQueued,
  kDropped,  ///< in order, but all frame buffers were in use: the tracker is behind
  kRefused   ///< not to be used, and not counted as a frame
};
struct PushResult {
  PushStatus status = PushStatus::kQueued;
  std::string reason;       ///< of kDropped and kRefused: one sentence that names what is wrong
  std::int64_t frame = -1;  ///< its PoseEstimate::frame; -1: it was refused, and has none

  explicit operator bool() const { return status == PushStatus::kQueued; }
};

/// What a stage of a thread took, over the whole run.
struct StageTime {
  std::string thread;  ///< tracker, mapper, loop closer
  std::string stage;   ///< "frame", "exposure to pose", "pose listener": the callbacks, ...
  std::uint64_t count = 0;
  double mean_ms = 0, p50_ms = 0, p99_ms = 0, max_ms = 0;
};

/// What a run came to.
struct SlamSummary {
  std::int64_t frames = 0;  ///< queued or dropped
  std::int64_t tracked = 0;
  std::int64_t placed_later =
      0;  ///< before one camera's start, which said where they were; not in `tracked` or `lost`
  std::int64_t lost = 0;  ///< unplaced ones included
  std::int64_t dropped = 0;
  /// Poses of the frames tracked or placed later in the final map, in the order of time: all, or those of the
  /// newest SlamOptions::kept_frames (some more). `map_part` of each tells its world.
  struct FinalPose {
    std::int64_t t_ns = 0;
    std::uint32_t map_part = kNoId;
    Pose T_world_camera;
  };
  std::vector<FinalPose> poses;  ///< 72 bytes each: 190 MB for a day at 30 Hz
  /// Those of one map part; of the part that has most of them, which is the whole run's unless a lost camera
  /// went on in another one.
  [[nodiscard]] TWOFOLD_API std::vector<StampedPose> trajectory(std::uint32_t map_part) const;
  [[nodiscard]] TWOFOLD_API std::vector<StampedPose> trajectory() const;
  /// Stereo: rows that right images lie lower than left ones, taken back while tracking [px]; 0: none. The
  /// pair should be calibrated again.
  double row_offset = 0;
  /// Of a camera's shutter, when CameraRig::readout did not say it; no value: it did, or nothing was
  /// measured.
  struct Readout {
    bool found = false;  ///< a rolling shutter, and the run went on with it
    double seconds = 0;  ///< from the first row's exposure to the last one's
    double sigma = 0;    ///< standard deviation [s]
    int pairs = 0;       ///< of frames, from which it was measured
  };
  std::optional<Readout> readout;
  std::vector<StageTime> timings;
  /// Requested settings (pinning, priority) that could not be applied; how the rig differs from the map's.
  std::vector<std::string> notes;
  /// What went wrong on the way: a callback that threw, a thread that ended, a file that lost something.
  std::vector<std::string> errors;
};

/// Versions of the map that somebody holds.
struct HeldMaps {
  /// Distinct snapshots: one version with newer places or loops counts again.
  std::size_t versions = 0;
  std::uint64_t oldest = 0;  ///< number of the oldest of them; 0: none
};

/// Frames in, poses and a map out.
///
///   Slam slam(rig, {});
///   slam.on_pose([](const PoseEstimate& pose) { ... });
///   while (camera >> frame) slam.push(frame);
///   slam.finish();
///
/// Threads: every function may be called by any thread, several at once; within a callback, only those that
/// on_pose names. Threads that push take turns.
class TWOFOLD_API Slam {
 public:
  using PoseCallback = std::function<void(const PoseEstimate&)>;
  using EventCallback = std::function<void(const MapEvent&)>;
  using FrameCallback = std::function<void(const PoseEstimate&, const FrameDetails&)>;

  /// Throws std::invalid_argument when rig or options make no sense, naming the field, and std::runtime_error
  /// when a file cannot be used or the rig is not the map's. One that was calibrated again is, and
  /// SlamSummary::notes tells what differs, if its size is the same and nothing is seen by more than a pixel
  /// elsewhere than with the map's intrinsics and baseline; else the reason has the numbers. One camera with
  /// SlamOptions::localise_only in a rig's map may be any whose fx and fy are the rig's within 3 %; without,
  /// it is refused there. A processor or priority that the system refuses is no error: SlamSummary::notes
  /// tells.
  Slam(const CameraRig& rig, const SlamOptions& options);
  /// Finishes, after end_pace.
  ~Slam();
  Slam(const Slam&) = delete;
  Slam& operator=(const Slam&) = delete;

  /// Called for every frame that was looked at, on the tracker's thread (where the tracker's steps are taken
  /// by the caller's: on that one), which waits for it: it must not block, and may call latest, map,
  /// held_maps, pause_mapping, end_pace and errors only; push, has_room, wait_for_room, ended, step,
  /// save_map and finish would wait, and throw std::logic_error there. What it uses must live until finish
  /// has returned.
  /// The time it takes is a stage of its own among SlamSummary::timings ("pose listener"), and in the next
  /// frame's latency. A callback that throws is not called again; tracking goes on, and errors() says what it
  /// threw. To be set before the first push, else std::logic_error is thrown.
  void on_pose(PoseCallback callback);
  /// The same for corrections of the map; called before the pose of the frame that saw them.
  void on_event(EventCallback callback);
  /// The same with what the tracker did for the frame, called once it is done with that: for those who draw
  /// or record, and do not wait for the pose ("frame listener").
  void on_frame(FrameCallback callback);

  /// In a threaded run it never waits for tracking or mapping. It may wait briefly for the library's own
  /// bookkeeping (20 times a second at most, no longer than it takes to copy the records of the frames done
  /// since), and for another thread inside push, has_room, wait_for_room or finish: do not call finish on one
  /// thread while another, which must not wait, goes on pushing. In a deterministic run or a replay it
  /// returns when the frame is tracked and mapped. Refused are images that do not fit the rig, time stamps
  /// that do not increase, and frames after finish(). An exception of the engine, as std::bad_alloc, comes
  /// out of push in a deterministic run; in a threaded one it ends the thread it arose on, and errors() says
  /// so.
  PushResult push(const FrameView& frame);
  /// Whether a push would find room now; without another pushing thread, it will. Without a pace (`live`,
  /// `speed`), also whether map and disk follow: a push is not dropped for their sake.
  [[nodiscard]] bool has_room() const;
  /// Waits until has_room, at most for `timeout_ns` (negative: for ever): for recordings, of which no frame
  /// should be dropped, and which the map should follow.
  /// @return false after that time, when the run is over, or when a thread of the engine has failed
  [[nodiscard]] bool wait_for_room(std::int64_t timeout_ns);
  /// Whether no frame will be taken any more: finish() was called, a thread of the engine has failed
  /// (errors() has why), or the schedule of a replay has no more frames.
  [[nodiscard]] bool ended() const;

  /// Of RunMode::kStepped: takes one step on this thread. Any thread may take any step, different ones at
  /// once: the tracker on a thread that is never late, the others where there is time. A map that waits for
  /// its steps only grows old; but take all three kinds now and then, for each holds on to the versions of
  /// the map since its last one. Without a pace has_room asks for steps of the map, too; finish takes all
  /// that are left. Throws std::logic_error in other modes. What the step itself throws (std::bad_alloc, say)
  /// comes out as well, and the run has failed: finish() tells.
  /// @return false: there was nothing to do, or another thread is taking this step
  bool step(SlamStep step);

  /// Of the newest frame that was processed, tracked or lost; nothing before the first. Wait-free: no lock,
  /// no retry, whatever the tracker does.
  [[nodiscard]] std::optional<PoseEstimate> latest() const;

  /// The newest version of the map. O(1); the tracker and the mapper do not notice.
  [[nodiscard]] MapSnapshot map() const;
  [[nodiscard]] HeldMaps held_maps() const;
  /// Writes the newest version to a map file, on this thread, while the run goes on. The file is
  /// replaced atomically: a crash leaves either the old or the new version. All map parts go into one file,
  /// each with its own world. Throws std::runtime_error naming file and reason, also when there is no
  /// keyframe yet.
  void save_map(const std::filesystem::path& file) const;

  /// While paused, the map gets no keyframe: the camera is localised in what there is, as with localise_only,
  /// from the next frame or the one after it on; in a map without keyframes it stays lost. Wait-free, any
  /// thread, callbacks included. A replay pauses where its run did.
  void pause_mapping(bool paused);

  /// With `speed`: from now on no frame waits for its time, so that what is queued is tracked at once. For
  /// who wants finish to return soon, before it or while another thread is in it. Also in callbacks; the
  /// destructor does it by itself.
  void end_pace();

  /// What went wrong so far; tracking goes on unless it says otherwise. A thread that ended and a file that
  /// lost something or cannot be written are in it within a second, whether frames come or not.
  [[nodiscard]] std::vector<std::string> errors() const;

  /// Tracks what is queued, with `speed` when its time has come (end_pace), makes all poses agree globally,
  /// and ends the threads (SlamOptions::global_adjustment says what that takes). A second call
  /// gives the same answer. map() and save_map() then have the final map. The answer is a copy with all poses
  /// of the run (or those kept), and the Slam keeps one: the one place where memory grows with the time.
  SlamSummary finish();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Twofold's version, as "0.2.0".
[[nodiscard]] TWOFOLD_API const char* version();

}  // namespace twofold
