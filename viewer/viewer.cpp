#include "twofold/viewer.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <thread>
#include <variant>
#include <vector>

#include "base/processor_time.hpp"
#include "engine/clock.hpp"
#include "engine/spsc_ring.hpp"
#include "engine/worker.hpp"
#include "viewer/image_message.hpp"
#include "viewer/keyframe_images.hpp"
#include "viewer/look_times.hpp"
#include "viewer/server.hpp"
#include "viewer/truth.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kMapPeriodNs = 200'000'000;  // between two looks at the map while somebody watches
constexpr std::int64_t kNobodyPeriodNs =
    1'000'000'000;                             // likewise, of the keyframes alone, while nobody does
constexpr std::int64_t kMapShare = 60;         // the next look waits this many times what one cost
constexpr std::int64_t kDeviationShare = 120;  // likewise, of the points' standard deviations
constexpr std::size_t kFewPoints =
    300'000;  // of more, standard deviations would hold up viewers for a second
constexpr std::int64_t kImagePeriodNs = 200'000'000;
constexpr std::size_t kRing = 1024;
constexpr std::size_t kMostFailures = 16;

struct ToldFrame {
  PoseEstimate pose;
  std::array<std::int64_t, kViewStages> stage_ns{};
  std::size_t stages = 0;
  std::int64_t dropped = 0;  ///< frames before it, since the first that was told
  std::int64_t told_ns = 0;
};

struct ToldPoints {
  std::int64_t frame = 0;
  std::uint32_t count = 0;
  std::array<MeasuredPoint, 512> points;
};

struct ToldSurface {
  std::uint32_t part = 0;
  double edge = 0;
  std::vector<SurfacePiece> pieces;
};

struct HeldImage {
  std::int64_t frame = 0;
  ImageView pixels;
  std::shared_ptr<const void> owner;
};

/// Pixels without an owner are the caller's again when `show` returns.
HeldImage own_copy(std::int64_t frame, const ImageView& image) {
  const std::size_t row_bytes =
      static_cast<std::size_t>(image.width) * (image.format == ImageFormat::kGrey8 ? 1 : 3);
  const auto pixels =
      std::make_shared<std::vector<std::uint8_t>>(row_bytes * static_cast<std::size_t>(image.height));
  const auto* from = static_cast<const std::uint8_t*>(image.data);
  for (int v = 0; v < image.height; ++v)
    std::copy_n(from + v * image.stride, row_bytes, pixels->data() + static_cast<std::size_t>(v) * row_bytes);
  return {frame,
          {pixels->data(), image.width, image.height, static_cast<std::ptrdiff_t>(row_bytes), image.format},
          pixels};
}

const ViewerOptions& valid(const ViewerOptions& options) {
  if (const std::string why = options.invalid_reason(); !why.empty())
    throw std::invalid_argument("options." + why);
  return options;
}

ViewTitle title_of(const CameraRig& rig, const ViewerOptions& options) {
  ViewTitle title;
  title.title = options.title;
  title.rig = rig;
  title.stages = options.stages;
  title.period_ms = 1e3 * options.frame_period;
  title.metres = options.metric.value_or(rig.sensor != Sensor::kMono);
  title.efforts = options.efforts;
  title.paced_by = options.paced_by;
  title.has_deviations = true;
  title.control = static_cast<bool>(options.on_command);
  title.keyframe_images = static_cast<bool>(options.recorded_image);
  return title;
}

const char* describe(ViewCommand command) {
  switch (command) {
    case ViewCommand::kSaveMap:
      return "map saved";
    case ViewCommand::kStop:
      return "run stopped";
    case ViewCommand::kPauseMapping:
      return "mapping paused";
    case ViewCommand::kResumeMapping:
      break;
  }
  return "mapping resumed";
}

std::string measured_message(const ToldPoints& told) {
  const ViewMessageHeader header{ViewMessageKind::kMeasured, static_cast<std::uint32_t>(told.frame),
                                 told.count};
  std::string message(reinterpret_cast<const char*>(&header), sizeof header);
  message.append(reinterpret_cast<const char*>(told.points.data()), told.count * sizeof(MeasuredPoint));
  return message;
}

/// Images of keyframes by their time stamps; empty when there are none.
KeyframeImages::Find find_images(const std::function<MapSnapshot()>& map, const ViewerOptions& options) {
  if (!map || !options.recorded_image) return {};
  return [map, recorded = options.recorded_image](std::uint32_t id) {
    const auto keyframes = map().keyframes();
    const auto at = std::lower_bound(
        keyframes.begin(), keyframes.end(), id,
        [](const MapSnapshot::Keyframe& keyframe, std::uint32_t wanted) { return keyframe.id < wanted; });
    const bool is_own = at != keyframes.end() && at->id == id && !at->loaded;  // others' times are not
    return is_own ? recorded(at->t_ns) : ViewedImage();                        // of this recording
  };
}

/// Done, or why it could not be.
ViewEvent outcome_of(ViewCommand command, const std::function<std::string(ViewCommand)>& obey,
                     ViewScene& scene) {
  ViewEvent event;
  try {
    event.text = obey(command);
    event.kind = describe(command);
    if (command == ViewCommand::kPauseMapping) scene.set_mapping_paused(true);
    if (command == ViewCommand::kResumeMapping) scene.set_mapping_paused(false);
  } catch (const std::exception& error) {
    event.kind = "command failed";
    event.text = error.what();
  } catch (...) {
    event.kind = "command failed";
  }
  return event;
}

}  // namespace

class TWOFOLD_HIDDEN Viewer::Impl {
 public:
  Impl(const CameraRig& rig, std::function<MapSnapshot()> map, const ViewerOptions& options)
      : map_(std::move(map)),
        options_(valid(options)),
        title_(title_of(rig, options)),
        keyframe_images_(find_images(map_, options_)),
        truth_(options.truth, options.truth_t_ns, !title_.metres),
        server_({options.bind, options.port, options.secrets}, scene_, title_) {
    if (map_ && !title_.metres) scene_.find_scales();
    for (auto& frame : shown_)
      frame.store(-1, std::memory_order_relaxed);  // relaxed: nobody else is there yet
    thread_.emplace(WorkerOptions{.name = "viewer", .time_slice = kPatientSlice},
                    [this](const std::stop_token& stop) {
                      self_.store(std::this_thread::get_id(),
                                  std::memory_order_relaxed);  // relaxed: read by this thread, or not equal
                      server_.run(
                          stop,
                          [this](const ViewServer::Audience& audience, ViewSight& newest) {
                            tick(audience, newest);
                            return next_look(audience);
                          },
                          [] { return std::string("the run is over"); });
                    });
  }
  ~Impl() {
    thread_.reset();                                // stops and joins; nobody else may be in here any more
    delete image_.load(std::memory_order_relaxed);  // relaxed: both threads are gone
  }

  /// Frames whose numbers were left out between this one and the one told before, and all before that.
  std::int64_t count_dropped(std::int64_t frame) {
    if (next_frame_ >= 0 && frame > next_frame_) dropped_ += frame - next_frame_;
    next_frame_ = frame + 1;
    return dropped_;
  }
  void push(const std::variant<ToldFrame, MapEvent>& told) {
    (void)ring_.try_push(std::variant<ToldFrame, MapEvent>(told));  // full: the page does without
  }
  /// The newest image wins; the older is freed here.
  void put(HeldImage* image) {
    shown_[images_++ % shown_.size()].store(image->frame, std::memory_order_relaxed);
    delete image_.exchange(image, std::memory_order_acq_rel);
  }
  bool wants_image() const {
    const bool taken = image_.load(std::memory_order_acquire) == nullptr;
    return taken && wants_image_.load(std::memory_order_relaxed);
  }
  bool has_shown(std::int64_t frame) const {
    return std::any_of(shown_.begin(), shown_.end(),
                       [frame](const auto& shown) { return shown.load(std::memory_order_relaxed) == frame; });
  }
  void push(const ToldPoints& points) { (void)points_.try_push(ToldPoints(points)); }  // likewise
  void set_waiting(const QueueLengths& waiting) {
    frames_waiting_.store(waiting.frames, std::memory_order_relaxed);
    keyframes_waiting_.store(waiting.keyframes, std::memory_order_relaxed);
    places_waiting_.store(waiting.places, std::memory_order_relaxed);
  }
  void set_lost(std::int64_t frames) { frames_lost_.store(frames, std::memory_order_relaxed); }
  void put_surface(ToldSurface&& surface) {
    const std::scoped_lock lock(surfaces_mutex_);
    surfaces_.push_back(std::move(surface));
  }
  const ViewServer& server() const { return server_; }
  void finish() {
    if (self_.load(std::memory_order_relaxed) == std::this_thread::get_id())
      throw std::logic_error("a viewer is not finished by what it calls");
    const std::scoped_lock lock(finishing_);
    if (!thread_) return;
    thread_->request_stop();
    (void)thread_->join();
    thread_.reset();
  }

 private:
  void tick(const ViewServer::Audience& audience, ViewSight& newest) {
    listen();
    for (const ViewCommand command : audience.commands) obey(command);
    attempt("the map cannot be shown", [&] { look_at_map(audience); });
    attempt("the camera's image cannot be shown",
            [&] { look_at_image(audience.wants_images, newest.image); });
    attempt("a keyframe's image cannot be shown",
            [&] { keyframe_images_.answer(audience.keyframes, steady_now_ns(), newest); });
    attempt("the surface cannot be shown", [&] { look_at_surface(); });
    ToldPoints points;
    while (points_.try_pop(points)) newest.measured.put(measured_message(points));
  }

  ViewServer::Clock::time_point next_look(const ViewServer::Audience& audience) const {
    const std::chrono::nanoseconds period =
        audience.viewers > 0 ? ViewServer::kLookPeriod : ViewServer::kNobodyLookPeriod;
    return ViewServer::Clock::time_point(
        std::chrono::nanoseconds(look_times_.next(steady_now_ns(), period.count())));
  }

  /// What a callback or a library throws ends nothing but this attempt; each failure is told once.
  template <class Attempt>
  void attempt(const char* failure, const Attempt& attempt) {
    std::string why;
    try {
      return attempt();
    } catch (const std::exception& error) {
      why = std::string(": ") + error.what();
    } catch (...) {  // only that it failed is known
    }
    if (failures_.size() >= kMostFailures || !failures_.insert(failure + why).second) return;
    add_here({.kind = "viewer", .text = failure + why});
  }

  /// Something that happened where the camera is now.
  void add_here(ViewEvent event) {
    event.frame = static_cast<std::uint32_t>(newest_.frame);
    event.part_before = event.part = newest_.map_part;
    event.before = event.after = newest_.T_world_camera.t;
    if (scene_.start_ns())
      event.t = static_cast<float>(1e-9 * static_cast<double>(newest_.t_ns - *scene_.start_ns()));
    scene_.add(std::move(event));
  }

  /// To what was told since the last time.
  void listen() {
    std::variant<ToldFrame, MapEvent> told;
    while (ring_.try_pop(told)) {
      if (const auto* frame = std::get_if<ToldFrame>(&told)) {
        newest_ = frame->pose;
        look_times_.add_frame(frame->pose.frame, frame->told_ns);
        scene_.add(frame->pose, std::span(frame->stage_ns).first(frame->stages),
                   {frames_waiting_.load(std::memory_order_relaxed),
                    keyframes_waiting_.load(std::memory_order_relaxed),
                    places_waiting_.load(std::memory_order_relaxed)},
                   {frame->dropped, frames_lost_.load(std::memory_order_relaxed)});
        find_truth(frame->pose);
      } else {
        scene_.add(std::get<MapEvent>(told));
      }
    }
  }

  /// What became of a command is an event, so that all viewers know.
  void obey(ViewCommand command) {
    if (!options_.on_command) return;
    ViewEvent event = outcome_of(command, options_.on_command, scene_);
    add_here(std::move(event));
  }

  void find_truth(const PoseEstimate& pose) {
    if (pose.state != TrackingState::kTracked) return;
    if (auto truth = truth_.add({pose.t_ns, pose.T_world_camera, pose.map_part}))
      scene_.set_truth(std::move(*truth));
  }

  /// Times are counted from the first pose, or, before there is one, from the map's first keyframe.
  void look_at_map(const ViewServer::Audience& audience) {
    const std::int64_t begin_cpu_ns = thread_cpu_ns();
    const bool watched = audience.viewers > 0;
    const bool due = audience.is_last || steady_now_ns() >= (watched ? map_due_ns_ : keyframes_due_ns_);
    if (!map_ || !due) return;
    map_due_ns_ = keyframes_due_ns_ = steady_now_ns() + kNobodyPeriodNs;  // should it be thrown
    const MapSnapshot map = map_();
    if (!scene_.start_ns()) {
      const auto keyframes = map.keyframes();
      if (keyframes.empty()) return;
      scene_.begin(keyframes.front().t_ns);
    }
    if (!watched) {
      scene_.show_keyframes(keyframes_of(map, *scene_.start_ns()), map.version());
    } else if (map.version() != scene_.map_version()) {
      ViewMap view = view_of(map, *scene_.start_ns(), false);
      deviations_.put_into(view.points);
      scene_.show(view);
    }
    if (audience.is_last) scene_.release_events(std::numeric_limits<std::uint64_t>::max());
    scene_.add_loops(map.loops());
    const std::int64_t now_ns = steady_now_ns();
    const std::int64_t rest_ns = kMapShare * (thread_cpu_ns() - begin_cpu_ns);
    map_due_ns_ = now_ns + std::max(kMapPeriodNs, rest_ns);
    keyframes_due_ns_ = now_ns + std::max(kNobodyPeriodNs, rest_ns);
    if (watched && now_ns >= deviations_due_ns_ && scene_.point_count() <= kFewPoints) find_deviations(map);
  }

  /// Apart from the map, which then is told as often as without them; seen with the map's next version.
  void find_deviations(const MapSnapshot& map) {
    const std::int64_t begin_cpu_ns = thread_cpu_ns();
    deviations_.find(map);
    deviations_due_ns_ =
        steady_now_ns() + std::max(kNobodyPeriodNs, kDeviationShare * (thread_cpu_ns() - begin_cpu_ns));
  }

  void look_at_surface() {
    std::vector<ToldSurface> told;
    {
      const std::scoped_lock lock(surfaces_mutex_);
      told.swap(surfaces_);
    }
    for (const ToldSurface& surface : told) scene_.surface().show(surface.part, surface.edge, surface.pieces);
  }

  void look_at_image(bool wanted, NewestMessage& newest) {
    const std::int64_t now_ns = steady_now_ns();
    if (!wanted) {
      wants_image_.store(false, std::memory_order_relaxed);
      delete image_.exchange(nullptr, std::memory_order_acq_rel);  // whose pixels may be a camera's
      return;
    }
    if (now_ns < image_due_ns_) return;
    wants_image_.store(false, std::memory_order_relaxed);
    const std::unique_ptr<HeldImage> image(image_.exchange(nullptr, std::memory_order_acq_rel));
    if (image == nullptr) return wants_image_.store(true, std::memory_order_relaxed);
    image_due_ns_ = now_ns + kImagePeriodNs;
    newest.put(image_message(ViewMessageKind::kImage, image->frame, image->pixels));
  }

  const std::function<MapSnapshot()> map_;
  const ViewerOptions options_;
  const ViewTitle title_;
  KeyframeImages keyframe_images_;
  TruthBeside truth_;
  ViewScene scene_;
  ViewServer server_;
  SpscRing<std::variant<ToldFrame, MapEvent>> ring_{kRing};
  SpscRing<ToldPoints> points_{8};
  PoseEstimate newest_;
  LookTimes look_times_;
  std::mutex surfaces_mutex_;  // guards surfaces_
  std::vector<ToldSurface> surfaces_;
  std::set<std::string> failures_;  // told
  PointDeviations deviations_;
  std::int64_t map_due_ns_ = 0, keyframes_due_ns_ = 0, deviations_due_ns_ = 0, image_due_ns_ = 0;
  // Exchanged by both ends, each with acquire and release: pixels written before are seen by whoever takes
  // them, and whoever frees them comes after their last reader.
  std::atomic<HeldImage*> image_{nullptr};
  // The viewer's thread alone writes it. Relaxed: that the wish has ended is seen by whoever sees, by
  // acquire, that image_ was taken; that it has begun publishes nothing.
  std::atomic<bool> wants_image_{false};
  // Frames whose images were put last. Relaxed: who is late in seeing one shows it without its points.
  std::array<std::atomic<std::int64_t>, 16> shown_;
  std::size_t images_ = 0;                      // the source's
  std::int64_t next_frame_ = -1, dropped_ = 0;  // the teller's
  // Relaxed: numbers to be shown; they need not be of one moment.
  std::atomic<std::int64_t> frames_waiting_{-1}, keyframes_waiting_{-1}, places_waiting_{-1},
      frames_lost_{-1};
  std::atomic<std::thread::id> self_{};
  std::mutex finishing_;          // guards thread_ from there on
  std::optional<Worker> thread_;  // last: joins before what it uses is destroyed
};

Viewer::Viewer(const CameraRig& rig, std::function<MapSnapshot()> map, const ViewerOptions& options)
    : impl_(std::make_unique<Impl>(rig, std::move(map), options)) {}
Viewer::~Viewer() = default;

std::string Viewer::address() const {
  return impl_->server().address();
}

std::vector<std::string> Viewer::addresses() const {
  return impl_->server().addresses();
}

int Viewer::port() const {
  return impl_->server().port();
}

bool Viewer::is_open_to_network() const {
  return impl_->server().is_open_to_network();
}

void Viewer::tell(const PoseEstimate& pose, std::span<const std::int64_t> stage_ns) {
  ToldFrame frame{pose};
  frame.dropped = impl_->count_dropped(pose.frame);
  frame.told_ns = steady_now_ns();
  frame.stages = std::min(stage_ns.size(), frame.stage_ns.size());
  std::copy_n(stage_ns.begin(), frame.stages, frame.stage_ns.begin());
  impl_->push(frame);
}

void Viewer::tell(const PoseEstimate& pose, const FrameDetails& details) {
  if (pose.state == TrackingState::kTracked && impl_->has_shown(pose.frame)) {
    ToldPoints told;
    told.frame = pose.frame;
    told.count = static_cast<std::uint32_t>(details.points(told.points));
    impl_->push(told);
  }
  impl_->set_waiting(details.waiting());
  tell(pose, details.stage_ns());
}

void Viewer::tell(const MapEvent& event) {
  impl_->push(event);
}

bool Viewer::wants_points(std::int64_t frame) const {
  return impl_->has_shown(frame);
}

void Viewer::tell(std::int64_t frame, std::span<const MeasuredPoint> points) {
  ToldPoints told;
  told.frame = frame;
  told.count = static_cast<std::uint32_t>(std::min(points.size(), told.points.size()));
  std::copy_n(points.begin(), told.count, told.points.begin());
  impl_->push(told);
}

void Viewer::tell_waiting(const QueueLengths& waiting) {
  impl_->set_waiting(waiting);
}

void Viewer::tell_lost(std::int64_t frames) {
  impl_->set_lost(frames);
}

bool Viewer::wants_image() const {
  return impl_->wants_image();
}

void Viewer::show(std::int64_t frame, const ImageView& left, std::shared_ptr<const void> owner) {
  if (!can_be_shown(left)) return;
  impl_->put(new HeldImage(owner ? HeldImage{frame, left, std::move(owner)} : own_copy(frame, left)));
}

void Viewer::show_surface(std::uint32_t part, double cell_size, std::vector<SurfacePiece> pieces) {
  impl_->put_surface({part, cell_size, std::move(pieces)});
}

void Viewer::finish() {
  impl_->finish();
}

}  // namespace twofold
