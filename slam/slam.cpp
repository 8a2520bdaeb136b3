#include "twofold/slam.hpp"

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <fstream>
#include <mutex>
#include <stdexcept>
#include <stop_token>
#include <thread>

#include "engine/clock.hpp"
#include "engine/pipeline.hpp"
#include "graph/map_file.hpp"
#include "slam/conversions.hpp"
#include "slam/deadline.hpp"
#include "slam/fair_mutex.hpp"
#include "slam/frame_details.hpp"
#include "slam/frame_intake.hpp"
#include "slam/guarded_callback.hpp"
#include "slam/latest_value.hpp"
#include "slam/map_lender.hpp"
#include "slam/map_snapshot.hpp"
#include "slam/pose_reporter.hpp"
#include "slam/slam_options.hpp"
#include "slam/summary.hpp"

namespace twofold {
namespace {

constexpr const char* kThreadEnded = "a thread of the engine has ended early: finish() says why";
constexpr const char* kStepFailed = "a step of the engine has failed: finish() says why";

PipelineStep to_engine(SlamStep step) {
  switch (step) {
    case SlamStep::kTrack:
      return PipelineStep::kTrack;
    case SlamStep::kMap:
      return PipelineStep::kMap;
    case SlamStep::kCloseLoops:
      break;
  }
  return PipelineStep::kCloseLoops;
}

QueueLengths to_queue_lengths(const WaitingCounts& waiting) {
  return {static_cast<std::int64_t>(waiting.frames), static_cast<std::int64_t>(waiting.keyframes),
          static_cast<std::int64_t>(waiting.places)};
}

/// Says which thread is in a callback, while it is.
class Telling {
 public:
  explicit Telling(std::atomic<std::thread::id>& by) : by_(by) {
    by_.store(std::this_thread::get_id(), std::memory_order_relaxed);
  }
  Telling(const Telling&) = delete;
  ~Telling() { by_.store({}, std::memory_order_relaxed); }

 private:
  std::atomic<std::thread::id>& by_;
};

}  // namespace

class TWOFOLD_HIDDEN Slam::Impl {
 public:
  Impl(const CameraRig& camera_rig, const SlamOptions& options)
      : rig_(to_rig(camera_rig)),
        mode_(options.mode),
        live_(options.live),
        frame_buffers_(options.frame_buffers),
        trace_(options.trace),
        intake_(rig_) {
    EngineOptions engine = engine_options(options);
    engine.on_pose = [this](const PoseReport& report) { tell(report); };
    engine.on_frame = [this](const PoseReport& report) { tell_details(report); };
    engine.on_map = [this](const GraphSnapshot& graph, const DoubleWindow& window) {
      maps.publish(graph, window);
    };
    engine.on_places = [this](const KeyframeDatabase& places) { maps.publish(places); };
    engine.on_loop = [this](const ClosedLoop& loop) { maps.publish(loop); };
    engine.mapping_paused = &mapping_paused_;
    if (engine.map) loaded_keyframes_ = engine.map->graph.keyframe_count();
    reporter_.listen(engine);
    pipeline_ = options.mode == RunMode::kReplay ? make_replay(rig_, engine, schedule_to_replay(options))
                                                 : make_pipeline(rig_, engine);
    if (options.mode == RunMode::kThreaded || !options.run_folder.empty())
      caretaker_ = std::jthread([this](const std::stop_token& stop) { look_now_and_then(stop); });
  }

  template <class Callback, class Function>
  void set(Callback& callback, Function function) {
    expect_no_callback(callback.name().c_str());
    const std::scoped_lock turn(pushing_);
    if (pushed_ || summary_) throw std::logic_error("callbacks are set before the first push");
    callback.set(std::move(function));
  }

  PushResult push(const FrameView& frame);
  /// Empty when the frame can be tracked.
  [[nodiscard]] std::string refusal(const FrameView& frame);
  bool wait_for_room(std::int64_t timeout_ns);
  [[nodiscard]] bool ended() {
    expect_no_callback("ended");
    const std::scoped_lock turn(pushing_);
    return over();
  }
  [[nodiscard]] bool has_room() {
    expect_no_callback("has_room");
    const std::scoped_lock turn(pushing_);
    return !over() && has_room_now();
  }
  bool step(SlamStep step);
  void end_pace();
  void pause_mapping(bool paused) { mapping_paused_.store(paused, std::memory_order_relaxed); }
  [[nodiscard]] std::vector<std::string> errors() const;
  void save_map(const std::filesystem::path& file);
  const SlamSummary& finish();

  GuardedCallback<PoseEstimate> on_pose{"on_pose"};
  GuardedCallback<MapEvent> on_event{"on_event"};
  GuardedCallback<PoseEstimate, FrameDetails> on_frame{"on_frame"};
  LatestValue<PoseEstimate> latest;
  MapLender maps;
  [[nodiscard]] MapSnapshot newest_map() {
    return MapSnapshot(std::make_shared<const MapSnapshot::Impl>(
        MapSnapshot::Impl{rig_, maps.newest(), loaded_keyframes_, row_offset_}));
  }

 private:
  void let_pipeline_go();
  void tell(const PoseReport& report);
  void tell_details(const PoseReport& report);
  void expect_no_callback(const char* function) const;
  [[nodiscard]] bool over() { return summary_ || failed() || pipeline_->ended(); }
  void look_now_and_then(const std::stop_token& stop);
  [[nodiscard]] const char* why_it_failed() const {
    return mode_ == RunMode::kThreaded ? kThreadEnded : kStepFailed;
  }
  [[nodiscard]] bool has_room_now() {
    pipeline_->collect({});
    return pipeline_->has_room();
  }
  /// A step of the engine has failed. errors() says so from now on, and what is wrong with its files.
  [[nodiscard]] bool failed();
  // Empty, or what went wrong.
  [[nodiscard]] std::string checkpoint_error() const;
  [[nodiscard]] std::string write_trace(const RunResult& result) const;

  const Rig rig_;
  const RunMode mode_;
  const bool live_;
  const int frame_buffers_;
  const std::filesystem::path trace_;
  std::uint32_t loaded_keyframes_ = 0;  // of the map that the run went on with: the first ids
  // Written by the tracker, read by who makes a surface. Relaxed: a number, with which nothing else goes.
  const std::shared_ptr<std::atomic<double>> row_offset_ = std::make_shared<std::atomic<double>>(0);
  std::atomic<bool> mapping_paused_{false};  // relaxed: a wish
  PoseReporter reporter_;                    // tracker's
  PoseEstimate estimate_;                    // likewise: of the frame in hand
  std::atomic<std::thread::id>
      told_by_{};  // the thread that is in a callback. Relaxed: read by itself, or unequal

  FairMutex pushing_;  // guards what follows: whoever pushes or finishes has his turn
  FrameIntake intake_;
  bool pushed_ = false;
  std::int64_t no_room_ = 0;  // frames dropped on the way in
  std::optional<SlamSummary> summary_;

  mutable std::mutex errors_;  // guards what follows
  std::string engine_error_;
  std::vector<std::string> file_errors_;
  // Changes with both pushing_ and pipeline_goes_. Late: its threads end before what they use is destroyed.
  std::unique_ptr<Pipeline> pipeline_;
  std::mutex pipeline_goes_;  // never held for long: finish must not keep end_pace waiting
  std::jthread caretaker_;
};

/// On the tracker's thread.
void Slam::Impl::tell(const PoseReport& report) {
  const Telling telling(told_by_);
  row_offset_->store(report.row_offset, std::memory_order_relaxed);
  reporter_.tell(report, on_event, [this](const PoseEstimate& pose) {
    estimate_ = pose;
    latest.put(estimate_);
    on_pose(estimate_);
  });
}

/// Likewise, once the tracker is done with the frame.
void Slam::Impl::tell_details(const PoseReport& report) {
  const Telling telling(told_by_);
  const FrameDetails::Impl details{rig_, report, to_queue_lengths(pipeline_->waiting())};
  on_frame(estimate_, FrameDetails(details));
}

/// From a callback it would wait for itself.
void Slam::Impl::expect_no_callback(const char* function) const {
  if (told_by_.load(std::memory_order_relaxed) == std::this_thread::get_id())  // relaxed: its own, or another
    throw std::logic_error(fmt::format("{} was called from a callback", function));
}

/// A run folder is whole however the process ends, and errors() knows of them, also when no frame comes for a
/// while.
void Slam::Impl::look_now_and_then(const std::stop_token& stop) {
  constexpr auto kPause = std::chrono::milliseconds(50);
  std::mutex sleeping;
  std::condition_variable_any woken;
  for (std::unique_lock lock(sleeping);
       !woken.wait_for(lock, stop, kPause, [&] { return stop.stop_requested(); });) {
    const std::unique_lock turn(pushing_, std::try_to_lock);  // who has it, looks
    if (!turn || summary_ || !pipeline_) continue;
    pipeline_->collect({});
    (void)failed();
  }
}

bool Slam::Impl::failed() {
  const bool ended = pipeline_->failed();
  std::vector<std::string> wrong = pipeline_->log_errors();
  if (std::string why = checkpoint_error(); !why.empty()) wrong.push_back(std::move(why));
  const std::scoped_lock lock(errors_);
  if (ended) engine_error_ = why_it_failed();
  file_errors_ = std::move(wrong);
  return ended;
}

std::string Slam::Impl::checkpoint_error() const {
  const std::string why = pipeline_->checkpoint_error();
  return why.empty() ? why : "no checkpoint could be written: " + why;
}

std::string Slam::Impl::write_trace(const RunResult& result) const {
  if (!result.trace) return "";
  std::ofstream out(trace_);
  return result.trace->write(out) ? "" : trace_.string() + ": the trace cannot be written";
}

std::string Slam::Impl::refusal(const FrameView& frame) {
  if (summary_) return "the run is over: finish() was called";
  if (failed()) return why_it_failed();
  if (pipeline_->ended()) return "the schedule has no more frames";
  if (std::string why = intake_.refusal(frame); !why.empty()) return why;
  constexpr std::int64_t kPlausible = 10'000'000'000;  // what a live frame may be late [ns]
  const std::int64_t now_ns = steady_now_ns();
  if (live_ && (frame.t_ns < now_ns - kPlausible || frame.t_ns > now_ns + kPlausible))
    return fmt::format("a live frame's time must be of CLOCK_MONOTONIC; this one's is {:.3f} s from now",
                       (static_cast<double>(frame.t_ns) - static_cast<double>(now_ns)) * 1e-9);
  return "";
}

PushResult Slam::Impl::push(const FrameView& frame) {
  expect_no_callback("push");
  const std::scoped_lock turn(pushing_);
  if (std::string why = refusal(frame); !why.empty()) return {PushStatus::kRefused, std::move(why)};
  pushed_ = true;
  maps.catch_up();
  pipeline_->collect({});
  if (!pipeline_->has_buffer()) {
    ++no_room_;
    return {PushStatus::kDropped,
            fmt::format("the tracker is behind: all {} frame buffers are in use", frame_buffers_),
            intake_.skip(frame)};
  }
  Frame taken = intake_.take(frame);
  const std::int64_t number = taken.index;
  try {
    pipeline_->push(std::move(taken));
  } catch (...) {
    (void)failed();
    throw;
  }
  if (mode_ == RunMode::kReplay) (void)failed();  // within the push
  return {PushStatus::kQueued, "", number};
}

bool Slam::Impl::wait_for_room(std::int64_t timeout_ns) {
  expect_no_callback("wait_for_room");
  const auto deadline = deadline_of(timeout_ns);
  constexpr auto kTurn = std::chrono::milliseconds(10);  // then others have theirs; failures are looked for
  for (;;) {
    const std::scoped_lock turn(pushing_);
    if (over()) return false;
    if (has_room_now()) return true;
    const auto now = std::chrono::steady_clock::now();
    if (now >= deadline) return false;
    pipeline_->wait(std::min(deadline, now + kTurn));
  }
}

bool Slam::Impl::step(SlamStep step) {
  expect_no_callback("step");
  if (mode_ != RunMode::kStepped)
    throw std::logic_error("steps are taken from outside with RunMode::kStepped");
  try {
    return pipeline_->step(to_engine(step));
  } catch (...) {
    const std::scoped_lock lock(errors_);
    engine_error_ = kStepFailed;
    throw;
  }
}

std::vector<std::string> Slam::Impl::errors() const {
  std::vector<std::string> errors;
  if (const auto error = on_event.error()) errors.push_back(*error);
  if (const auto error = on_pose.error()) errors.push_back(*error);
  if (const auto error = on_frame.error()) errors.push_back(*error);
  const std::scoped_lock lock(errors_);
  if (!engine_error_.empty()) errors.push_back(engine_error_);
  errors.insert(errors.end(), file_errors_.begin(), file_errors_.end());
  return errors;
}

void Slam::Impl::save_map(const std::filesystem::path& file) {
  expect_no_callback("save_map");
  const auto map = maps.newest();
  if (map->graph.keyframe_count() == 0)
    throw std::runtime_error(file.string() + ": there is no map yet: no keyframe was made");
  twofold::save_map(file, rig_, map->graph, map->places);
}

void Slam::Impl::end_pace() {
  const std::scoped_lock lock(pipeline_goes_);
  if (pipeline_) pipeline_->end_pace();
}

void Slam::Impl::let_pipeline_go() {
  std::unique_ptr<Pipeline> gone;
  const std::scoped_lock lock(pipeline_goes_);
  gone = std::move(pipeline_);
}

const SlamSummary& Slam::Impl::finish() {
  expect_no_callback("finish");
  const std::scoped_lock turn(pushing_);
  if (summary_) return *summary_;
  pipeline_->stop();
  RunResult result = pipeline_->finish();
  summary_ = summarise(result);
  summary_->frames += no_room_;
  summary_->dropped += no_room_;
  std::vector<std::string> wrong = result.losses;
  for (std::string why : {checkpoint_error(), write_trace(result)})
    if (!why.empty()) wrong.push_back(std::move(why));
  if (mode_ != RunMode::kStepped) let_pipeline_go();  // else other threads may still ask it for a step
  {
    const std::scoped_lock lock(errors_);
    engine_error_ = result.error;
    file_errors_ = std::move(wrong);
  }
  summary_->errors = errors();
  return *summary_;
}

Slam::Slam(const CameraRig& rig, const SlamOptions& options) : impl_(std::make_unique<Impl>(rig, options)) {}

Slam::~Slam() {
  try {
    impl_->end_pace();
    impl_->finish();
  } catch (...) {  // nobody is left to be told
  }
}

void Slam::on_pose(PoseCallback callback) {
  impl_->set(impl_->on_pose, std::move(callback));
}

void Slam::on_frame(FrameCallback callback) {
  impl_->set(impl_->on_frame, std::move(callback));
}

void Slam::on_event(EventCallback callback) {
  impl_->set(impl_->on_event, std::move(callback));
}

PushResult Slam::push(const FrameView& frame) {
  return impl_->push(frame);
}

bool Slam::has_room() const {
  return impl_->has_room();
}

bool Slam::ended() const {
  return impl_->ended();
}

bool Slam::wait_for_room(std::int64_t timeout_ns) {
  return impl_->wait_for_room(timeout_ns);
}

bool Slam::step(SlamStep step) {
  return impl_->step(step);
}

std::optional<PoseEstimate> Slam::latest() const {
  return impl_->latest.get();
}

MapSnapshot Slam::map() const {
  return impl_->newest_map();
}

HeldMaps Slam::held_maps() const {
  const MapLender::Loans loans = impl_->maps.held();
  return {loans.versions, loans.oldest};
}

void Slam::save_map(const std::filesystem::path& file) const {
  impl_->save_map(file);
}

void Slam::pause_mapping(bool paused) {
  impl_->pause_mapping(paused);
}

void Slam::end_pace() {
  impl_->end_pace();
}

std::vector<std::string> Slam::errors() const {
  return impl_->errors();
}

SlamSummary Slam::finish() {
  return impl_->finish();
}

const char* version() {
  return TWOFOLD_VERSION;
}

}  // namespace twofold
