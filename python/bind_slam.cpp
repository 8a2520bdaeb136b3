#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <map>
#include <mutex>
#include <stdexcept>

#include <fmt/format.h>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/browser_view.hpp"
#include "python/frames.hpp"
#include "python/map_rows.hpp"
#include "python/trajectory.hpp"
#include "twofold/pose_queue.hpp"
#include "twofold/slam.hpp"

namespace twofold::python {
namespace {

using Unlocked = py::call_guard<py::gil_scoped_release>;

constexpr std::size_t kItemsAFrame = 3;  // a pose, and at most two events before it

std::int64_t to_ns(double seconds) {
  constexpr double kForEver = 9e9;  // longer than what 64 bits of nanoseconds hold
  return seconds >= 0 && seconds < kForEver ? static_cast<std::int64_t>(seconds * 1e9) : -1;
}

/// Python's end of a queue: who asks takes turns.
class Updates {
 public:
  explicit Updates(std::size_t capacity) : queue(capacity) {}

  /// None when nothing came in time; StopIteration after the end.
  py::object next(double timeout) {
    PoseOrEvent item;
    QueueStatus status = QueueStatus::kTimeout;
    {
      const py::gil_scoped_release unlocked;
      const std::scoped_lock turn(readers_);
      status = queue.next(item, to_ns(timeout));
    }
    if (status == QueueStatus::kEnd) throw py::stop_iteration();
    if (status == QueueStatus::kTimeout) return py::none();
    return std::visit([](const auto& value) { return py::cast(value); }, item);
  }

  PoseQueue queue;

 private:
  std::mutex readers_;  // never held by a thread that wants the interpreter's lock
};

/// Of options that Slam takes; others it refuses, naming the field.
std::size_t frame_buffers_of(const SlamOptions& options) {
  return static_cast<std::size_t>(std::clamp(options.frame_buffers, 1, 65536));
}

/// Slam, the queue that its tracker puts poses and events into, and its viewer: no Python runs on the
/// tracker's thread.
class SlamWithUpdates {
 public:
  SlamWithUpdates(const CameraRig& camera_rig, const SlamOptions& options)
      : rig(camera_rig),
        live(options.live),
        keeps_pace(options.live || options.speed > 0),
        items_in_flight(kItemsAFrame * (frame_buffers_of(options) + 1)),
        updates(std::make_shared<Updates>(std::bit_ceil(std::max<std::size_t>(512, 4 * items_in_flight)))),
        slam(camera_rig, options) {
    slam.on_pose([queue = &updates->queue](const PoseEstimate& pose) { queue->put(pose); });
    slam.on_frame(
        [this](const PoseEstimate& pose, const FrameDetails& details) { view.tell(pose, details); });
    slam.on_event([queue = &updates->queue, this](const MapEvent& event) {
      queue->put(event);
      view.tell(event);
    });
  }
  /// Whoever reads comes to the end.
  ~SlamWithUpdates() {
    slam.end_pace();
    finish();
    view.close();
  }

  PushResult push(const FrameView& frame) {
    PushResult pushed = slam.push(frame);
    if (pushed) view.show(pushed.frame, frame);
    return pushed;
  }

  SlamSummary finish() {
    finishing.store(true, std::memory_order_relaxed);  // it carries nothing else
    struct Close {  // also when finish throws: who waits for updates must learn that there are no more
      PoseQueue& queue;
      ~Close() { queue.close(); }
    } close{updates->queue};
    return slam.finish();
  }

  const CameraRig rig;
  const bool live;        // frames come at a camera's pace
  const bool keeps_pace;  // at that, or at a recording's
  const std::size_t items_in_flight;
  const std::shared_ptr<Updates> updates;
  std::atomic<bool> finishing{false};  // a push that is refused from now on is none of the frame's fault
  BrowserView view;
  Slam slam;
};

struct DeleteUnlocked {
  void operator()(SlamWithUpdates* slam) const {
    {
      const py::gil_scoped_release unlocked;
      delete slam;
    }
    release_arrays();
  }
};

/// Pushes a source's frames until it ends or the reader of the updates closes them. A recording waits for
/// the map, and for whoever reads, unless it keeps its pace; a camera for nobody. Throws std::runtime_error
/// when a frame is refused.
void feed(Source& source, SlamWithUpdates& to) {
  PoseQueue& queue = to.updates->queue;
  FrameView frame;
  while (!queue.closed() && source.next(frame)) {
    if (!source.is_live()) {
      if (!to.keeps_pace && !queue.wait_for_room(to.items_in_flight)) return;
      while (!to.slam.wait_for_room(to_ns(0.1))) {
        if (queue.closed() || to.slam.ended()) return;
      }
    }
    const PushResult pushed = to.push(frame);
    if (pushed.status != PushStatus::kRefused) continue;
    if (to.finishing.load(std::memory_order_relaxed) || !to.slam.errors().empty()) return;
    throw std::runtime_error(fmt::format("a frame at {} ns was refused: {}", frame.t_ns, pushed.reason));
  }
}

void bind_initial_pose(py::module_& module) {
  const InitialPose d;
  py::class_<InitialPose>(module, "InitialPose",
                          "Where the camera is in a map made before, as far as somebody knows.")
      .def(py::init([](const Pose& T_world_camera, std::optional<std::uint32_t> map_part,
                       double position_sigma, double angle_sigma) {
             return InitialPose{T_world_camera, map_part.value_or(kNoId), position_sigma, angle_sigma};
           }),
           py::arg("T_world_camera"), py::kw_only(), py::arg("map_part") = py::none(),
           py::arg("position_sigma") = d.position_sigma, py::arg("angle_sigma") = d.angle_sigma,
           "T_world_camera: of the rectified left camera; map_part: whose world that is, None: the oldest "
           "part's;\nposition_sigma: standard deviation of each coordinate [m], 0 to 10; angle_sigma: about "
           "each axis [rad], 0 to 1.")
      .def_readonly("T_world_camera", &InitialPose::T_world_camera, "Pose of the rectified left camera.")
      .def_property_readonly(
          "map_part", [](const InitialPose& self) { return known_id(self.map_part); },
          "Whose world that is; None: the oldest part's.")
      .def_readonly("position_sigma", &InitialPose::position_sigma,
                    "Standard deviation of each coordinate [m].")
      .def_readonly("angle_sigma", &InitialPose::angle_sigma, "Standard deviation about each axis [rad].");
}

void bind_push(py::module_& module) {
  py::enum_<PushStatus>(module, "PushStatus", "What became of a frame that was pushed.")
      .value("QUEUED", PushStatus::kQueued, "on its way to the tracker")
      .value("DROPPED", PushStatus::kDropped, "there was no room: the tracker is behind")
      .value("REFUSED", PushStatus::kRefused, "not to be used, and not counted as a frame");
  py::class_<PushResult>(module, "PushResult",
                         "Whether a frame was queued, dropped or refused; true when queued.")
      .def_readonly("status", &PushResult::status, "PushStatus.")
      .def_readonly("reason", &PushResult::reason, "Of dropped and refused frames: what is wrong.")
      .def_readonly("frame", &PushResult::frame,
                    "The number that its pose has; -1: it was refused, and has none.")
      .def("__bool__", [](const PushResult& self) { return static_cast<bool>(self); })
      .def("__repr__", [](const PushResult& self) {
        return self ? std::string("<PushResult: queued>") : "<PushResult: " + self.reason + ">";
      });
}

/// The poses of each map part, parts in the order of their ids.
std::map<std::uint32_t, PoseList> trajectories_of(const SlamSummary& summary) {
  std::map<std::uint32_t, PoseList> trajectories;
  for (const auto& pose : summary.poses)
    trajectories[pose.map_part].poses.push_back({pose.t_ns, pose.T_world_camera});
  return trajectories;
}

void bind_stage_time(py::module_& module) {
  py::class_<StageTime>(module, "StageTime", "What a stage of a thread took, over the whole run.")
      .def_readonly("thread", &StageTime::thread, "tracker, mapper or loop closer.")
      .def_readonly("stage", &StageTime::stage, "Its name.")
      .def_readonly("count", &StageTime::count, "How often it ran.")
      .def_readonly("mean_ms", &StageTime::mean_ms, "[ms].")
      .def_readonly("p50_ms", &StageTime::p50_ms, "Median [ms].")
      .def_readonly("p99_ms", &StageTime::p99_ms, "Of a hundred, one took longer [ms].")
      .def_readonly("max_ms", &StageTime::max_ms, "[ms].")
      .def("__repr__", [](const StageTime& self) {
        return fmt::format("<StageTime {}, {}: {} times, mean {:.3f} ms, p99 {:.3f} ms>", self.thread,
                           self.stage, self.count, self.mean_ms, self.p99_ms);
      });
}

void bind_summary(py::module_& module) {
  bind_stage_time(module);
  using Readout = SlamSummary::Readout;
  py::class_<Readout>(module, "Readout", "How long a rolling shutter takes, as a run measured it.")
      .def_readonly("found", &Readout::found, "Whether it is one, and the run went on with it.")
      .def_readonly("seconds", &Readout::seconds, "From the first row's exposure to the last one's [s].")
      .def_readonly("sigma", &Readout::sigma, "Its standard deviation [s].")
      .def_readonly("pairs", &Readout::pairs, "Pairs of frames that it was measured from.");
  py::class_<SlamSummary>(module, "Summary", "What a run came to.")
      .def_readonly("row_offset", &SlamSummary::row_offset,
                    "Stereo: rows that right images lie lower than left ones, taken back while tracking "
                    "[px]; 0: none.")
      .def_readonly("readout", &SlamSummary::readout,
                    "Readout of the camera's shutter; None when the rig says it, or nothing was measured.")
      .def_readonly("frames", &SlamSummary::frames, "Queued or dropped.")
      .def_readonly("tracked", &SlamSummary::tracked, "Frames whose pose was known at once.")
      .def_readonly("placed_later", &SlamSummary::placed_later,
                    "Before one camera's start, which said where they were.")
      .def_readonly("lost", &SlamSummary::lost, "Frames without a pose, unplaced ones included.")
      .def_readonly("dropped", &SlamSummary::dropped, "Frames there was no time or room for.")
      .def_property_readonly(
          "trajectory", [](const SlamSummary& self) { return PoseList{self.trajectory()}; },
          "Poses of the tracked frames in the final map: those of the map part that has most of them.")
      .def_property_readonly("trajectories", &trajectories_of,
                             "The same of every map part, by the part's id.")
      .def_readonly("timings", &SlamSummary::timings, "StageTime of each thread's stages.")
      .def_readonly(
          "notes", &SlamSummary::notes,
          "Requested settings that could not be applied; how the rig differs from the loaded map's.")
      .def_readwrite("errors", &SlamSummary::errors, "What went wrong on the way, a sentence each.")
      .def("__repr__", [](const SlamSummary& self) {
        return fmt::format("<Summary of {} frames: {} tracked, {} lost, {} dropped>", self.frames,
                           self.tracked, self.lost, self.dropped);
      });
}

using MaybePath = std::optional<std::filesystem::path>;

std::unique_ptr<SlamWithUpdates, DeleteUnlocked> make_slam(
    const CameraRig& rig, RunMode mode, bool live, double speed, std::optional<LateFrames> late,
    const MaybePath& map, bool localise_only, const std::optional<InitialPose>& initial_pose, bool places,
    const MaybePath& vocabulary, bool global_adjustment, const MaybePath& checkpoint,
    double checkpoint_period, const MaybePath& schedule, int inner_window, int outer_window,
    int frame_buffers, std::optional<int> tracker_cpu, std::optional<int> mapper_cpu,
    std::optional<int> loop_closer_cpu, std::optional<int> fifo_priority, const MaybePath& run_folder,
    std::int64_t kept_frames, const MaybePath& trace) {
  const SlamOptions options{mode,
                            live,
                            speed,
                            late,
                            map.value_or(""),
                            localise_only,
                            initial_pose,
                            places,
                            vocabulary.value_or(""),
                            global_adjustment,
                            checkpoint.value_or(""),
                            checkpoint_period,
                            schedule.value_or(""),
                            inner_window,
                            outer_window,
                            frame_buffers,
                            tracker_cpu,
                            mapper_cpu,
                            loop_closer_cpu,
                            fifo_priority,
                            run_folder.value_or(""),
                            kept_frames,
                            trace.value_or("")};
  const py::gil_scoped_release unlocked;
  return std::unique_ptr<SlamWithUpdates, DeleteUnlocked>(new SlamWithUpdates(rig, options));
}

PushResult push(SlamWithUpdates& self, const PythonFrame& frame) {
  release_arrays();
  const py::gil_scoped_release unlocked;
  return self.push(frame.view);
}

/// Opens the viewer and returns its address.
std::string view(SlamWithUpdates& self, const std::string& title, int port, const std::string& bind,
                 const MaybePath& secrets, const std::optional<PoseList>& truth) {
  ViewerOptions options;
  options.title = title;
  options.bind = bind;
  options.port = port;
  options.secrets = secrets.value_or("");
  options.stages = tracker_stages();
  options.efforts = effort_levels();
  if (self.keeps_pace) options.paced_by = self.live ? "camera" : "recording";
  for (const auto& pose : truth.value_or(PoseList{}).poses) {
    options.truth.push_back(pose.T_world_camera);
    options.truth_t_ns.push_back(pose.t_ns);
  }
  const py::gil_scoped_release unlocked;
  return self.view.open(self.rig, self.slam, options);
}

SlamSummary finish(SlamWithUpdates& self) {
  SlamSummary summary;
  {
    const py::gil_scoped_release unlocked;
    summary = self.finish();
  }
  release_arrays();
  return summary;
}

using SlamClass = py::class_<SlamWithUpdates, std::unique_ptr<SlamWithUpdates, DeleteUnlocked>>;

void define_constructor(SlamClass& slam) {
  const SlamOptions d;
  slam.def(py::init(&make_slam), py::arg("rig"), py::kw_only(), py::arg("mode") = d.mode,
           py::arg("live") = d.live, py::arg("speed") = d.speed, py::arg("late") = d.late,
           py::arg("map") = py::none(), py::arg("localise_only") = d.localise_only,
           py::arg("initial_pose") = py::none(), py::arg("places") = d.places,
           py::arg("vocabulary") = py::none(), py::arg("global_adjustment") = d.global_adjustment,
           py::arg("checkpoint") = py::none(), py::arg("checkpoint_period") = d.checkpoint_period,
           py::arg("schedule") = py::none(), py::arg("inner_window") = d.inner_window,
           py::arg("outer_window") = d.outer_window, py::arg("frame_buffers") = d.frame_buffers,
           py::arg("tracker_cpu") = d.tracker_cpu, py::arg("mapper_cpu") = d.mapper_cpu,
           py::arg("loop_closer_cpu") = d.loop_closer_cpu, py::arg("fifo_priority") = d.fifo_priority,
           py::arg("run_folder") = py::none(), py::arg("kept_frames") = d.kept_frames,
           py::arg("trace") = py::none());
}

void define_frames(SlamClass& slam) {
  slam.def(
          "push", &push, py::arg("frame"),
          "Queued, dropped because there is no room, or refused (images that do not fit the rig, time that "
          "does not grow),\n"
          "and why. Waits for no thread of the engine, but in a deterministic run tracks and maps the frame.")
      .def(
          "has_room", [](const SlamWithUpdates& self) { return self.slam.has_room(); }, Unlocked(),
          "Whether a push would find room now.")
      .def(
          "wait_for_room",
          [](SlamWithUpdates& self, double timeout) {
            if (std::isnan(timeout)) throw std::invalid_argument("timeout is not a number");
            return self.slam.wait_for_room(to_ns(std::max(timeout, 0.0)));
          },
          py::arg("timeout"), Unlocked(),
          "Waits at most for timeout [s] (infinity: for ever; not at all when it is negative); for "
          "recordings, of "
          "which no frame should be dropped.")
      .def_property_readonly(
          "ended",
          [](const SlamWithUpdates& self) {
            const py::gil_scoped_release unlocked;  // a deterministic push may be under way
            return self.slam.ended();
          },
          "Whether no frame will be taken any more: finish was called, a thread of the engine has failed, or "
          "the "
          "schedule of a replay has no more frames.")
      .def(
          "step", [](SlamWithUpdates& self, SlamStep step) { return self.slam.step(step); }, py::arg("step"),
          Unlocked(),
          "Of RunMode.STEPPED: takes one step of the engine on this thread. False: there was nothing to do, "
          "or "
          "another thread is\n"
          "taking this step.")
      .def(
          "latest", [](const SlamWithUpdates& self) { return self.slam.latest(); },
          "Of the newest frame that was processed, tracked or lost; None before the first. Waits for "
          "nobody.");
}

void define_map(SlamClass& slam) {
  slam.def(
          "map",
          [](const SlamWithUpdates& self) {
            const py::gil_scoped_release unlocked;
            return std::make_unique<MapRows>(self.slam.map());
          },
          "The newest version of the map; O(1).")
      .def(
          "held_maps",
          [](const SlamWithUpdates& self) {
            const HeldMaps held = self.slam.held_maps();
            return py::make_tuple(held.versions, held.oldest);
          },
          "How many versions of the map somebody holds, and the oldest of them; 0: none.")
      .def(
          "save_map",
          [](const SlamWithUpdates& self, const std::filesystem::path& file) { self.slam.save_map(file); },
          py::arg("file"), Unlocked(),
          "Writes the newest version to a map file, which is replaced atomically. Raises RuntimeError.")
      .def(
          "pause_mapping", [](SlamWithUpdates& self, bool paused) { self.slam.pause_mapping(paused); },
          py::arg("paused"),
          "While paused, the map gets no keyframe: the camera is localised in what there is. Waits for "
          "nobody.");
}

void define_end(SlamClass& slam) {
  slam.def(
          "end_pace", [](SlamWithUpdates& self) { self.slam.end_pace(); }, Unlocked(),
          "With `speed`: from now on no frame waits for its time, so that finish() returns soon, also when "
          "it "
          "is called by\n"
          "another thread already.")
      .def("errors", [](const SlamWithUpdates& self) { return self.slam.errors(); })
      .def("finish", &finish);
}

void define_view(SlamClass& slam) {
  slam.def("view", &view, py::kw_only(), py::arg("title") = "Twofold", py::arg("port") = ViewerOptions{}.port,
           py::arg("bind") = ViewerOptions{}.bind, py::arg("secrets") = py::none(),
           py::arg("truth") = py::none(),
           "Shows the run in a browser while it runs, and returns the address to open, whose token lets one "
           "look.\n"
           "port: 0 for any that is free; bind: any but a loopback address shows camera and map to the "
           "network,\n"
           "unencrypted; secrets: file that keeps the address's token from run to run; truth: Trajectory of "
           "the true path, in any world, scaled where one camera has a "
           "unit of "
           "its own.\n"
           "Nobody waits for who looks. Raises\n"
           "RuntimeError when it is open already, the port is taken, or the package was built without the "
           "viewer.")
      .def(
          "close_view", [](SlamWithUpdates& self) { self.view.close(); }, Unlocked(),
          "Whoever looks gets the last map and is told that the run is over. Happens by itself when the Slam "
          "goes.\n"
          "view() can open another one then, which shows the map, and what comes from there on.");
}

void bind_slam_class(py::module_& module) {
  SlamClass slam(module, "Slam");
  define_constructor(slam);
  define_frames(slam);
  define_map(slam);
  define_end(slam);
  define_view(slam);
  slam.def_property_readonly("_updates", [](const SlamWithUpdates& self) { return self.updates; });
}

}  // namespace

void bind_slam(py::module_& module) {
  py::enum_<RunMode>(module, "RunMode", "On which threads a Slam works, and in what order.")
      .value("THREADED", RunMode::kThreaded, "tracker, mapper and loop closer on threads of their own")
      .value("DETERMINISTIC", RunMode::kDeterministic, "all within push: same frames, same bytes")
      .value("REPLAY", RunMode::kReplay, "within push, in the order that `schedule` tells: that run's bytes")
      .value("STEPPED", RunMode::kStepped, "no threads: the caller's take the steps (Slam.step)");
  py::enum_<SlamStep>(module, "SlamStep", "What RunMode.STEPPED leaves to the caller.")
      .value("TRACK", SlamStep::kTrack, "locates the camera in the oldest frame that waits")
      .value("MAP", SlamStep::kMap, "takes in what the tracker proposed, and optimises the double window")
      .value("CLOSE_LOOPS", SlamStep::kCloseLoops, "looks up places: of a lost camera, of new keyframes");
  py::enum_<LateFrames>(module, "LateFrames",
                        "What becomes of a frame whose successor is due, too, when its turn comes.")
      .value("QUEUE", LateFrames::kQueue, "it is tracked: every frame is, however late")
      .value("DROP", LateFrames::kDrop, "it is dropped once leaving work out is not enough")
      .value("NEWEST", LateFrames::kNewest, "it is dropped: the newest one wins");
  bind_initial_pose(module);
  bind_push(module);
  bind_summary(module);
  py::class_<Updates, std::shared_ptr<Updates>>(module, "Updates")
      .def("next", &Updates::next, py::arg("timeout"))
      .def(
          "close", [](Updates& self) { self.queue.close(); }, Unlocked())
      .def("take_missed", [](Updates& self) { return self.queue.take_missed(); });
  bind_slam_class(module);
  module.def("feed", &feed, py::arg("source"), py::arg("slam"), Unlocked());
}

}  // namespace twofold::python
