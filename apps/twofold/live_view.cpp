#include "apps/twofold/live_view.hpp"

#include <CLI/CLI.hpp>
#include <charconv>
#include <opencv2/imgproc.hpp>

#include <fmt/format.h>

#include "apps/twofold/graph_export.hpp"
#include "apps/twofold/interrupt.hpp"
#include "apps/twofold/map_options.hpp"
#include "apps/twofold/run_output.hpp"
#include "engine/clock.hpp"
#include "engine/listeners.hpp"
#include "graph/map_file.hpp"
#include "io/files/io_error.hpp"
#include "slam/conversions.hpp"
#include "slam/frame_details.hpp"
#include "slam/map_snapshot.hpp"
#include "slam/surface_pieces.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kLossesPeriodNs = 500'000'000;

/// Of the last effort level, which drops frames if the run may.
std::vector<std::string> words_of_efforts(LatePolicy late) {
  std::vector<std::string> words = effort_levels();
  if (late == LatePolicy::kQueue) words.back() = "no more can be left out, and no frame is dropped";
  if (late == LatePolicy::kNewest) words.back() = "no more can be left out";
  return words;
}

std::string paced_by(const PacingOptions& pacing) {
  if (!pacing.keeps_pace()) return "";
  return pacing.live ? "camera" : "recording";
}

/// Digits and nothing else, up to 65535.
std::optional<int> port_of(const std::string& text) {
  int port = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole && port >= 0 && port <= 65535 ? std::optional(port) : std::nullopt;
}

ViewerOptions viewer_options(const ViewArguments& arguments, const std::string& title,
                             const FrameSource& source, const EngineOptions& engine) {
  ViewerOptions options;
  options.title = title;
  options.bind = arguments.bind;
  options.secrets = arguments.secrets;
  options.port = *arguments.port;
  options.stages = tracker_stages();
  options.efforts = words_of_efforts(engine.pacing.late);
  if (!engine.deterministic) options.paced_by = paced_by(engine.pacing);
  for (const TimedPose& pose : source.ground_truth()) {
    options.truth.push_back(to_pose(pose.T_w_c));
    options.truth_t_ns.push_back(pose.t_ns);
  }
  options.metric = !scale_is_arbitrary(source.rig(), engine);
  return options;
}

}  // namespace

void add_view_options(CLI::App& command, ViewArguments& arguments) {
  const auto take_port = [&arguments](const std::string& text) {
    arguments.port = port_of(text);
    if (arguments.port) return;
    throw CLI::ValidationError("--view", fmt::format("'{}' is no port: a number from 0 to 65535", text));
  };
  CLI::Option* view =
      command
          .add_option_function<std::string>("--view", take_port,
                                            fmt::format("Show the run in a browser while it runs, at port {} "
                                                        "of this machine or at PORT; 0: any that is free",
                                                        kUsualViewPort))
          ->expected(0, 1)
          ->default_str(std::to_string(kUsualViewPort))
          ->option_text("[PORT]");
  command
      .add_option("--view-bind", arguments.bind,
                  "Address to listen on: any but a loopback address shows camera and map to the network; "
                  "0.0.0.0: all of the machine's")
      ->capture_default_str()
      ->needs(view);
  command
      .add_option("--view-secrets", arguments.secrets,
                  "File that keeps the address's token, so that it stays the same from run to run and open "
                  "pages come back; made when it is not there")
      ->needs(view);
  command
      .add_flag("--view-control", arguments.control,
                "Viewers may save the map (to map.tfm in the output folder), pause mapping, and end the run")
      ->needs(view);
}

void print_view_addresses(const ViewAddresses& viewer) {
  for (const std::string& address : viewer.addresses) fmt::print(stderr, "view at     {}\n", address);
  if (!viewer.is_open_to_network) return;
  fmt::print(
      stderr,
      "note        whoever reaches this machine and sees this address sees the camera{0}, unencrypted; "
      "safer: no {1}, and `ssh -L {2}:localhost:{2} THIS_MACHINE` from there\n",
      viewer.control ? " and may end the run" : "", viewer.bind_option, viewer.port);
}

ViewedImage viewed_image(const cv::Mat& image) {
  if (image.empty()) return {};
  cv::Mat shown = image;
  if (image.channels() == 3) cv::cvtColor(image, shown, cv::COLOR_BGR2RGB);
  const auto owner = std::make_shared<const cv::Mat>(shown);
  return {{owner->data, owner->cols, owner->rows, static_cast<std::ptrdiff_t>(owner->step),
           image.channels() == 3 ? ImageFormat::kRgb8 : ImageFormat::kGrey8},
          owner};
}

LiveView::LiveView(const ViewArguments& arguments, const std::string& title,
                   const std::filesystem::path& folder, const FrameSource& source,
                   const RecordedImages& images, EngineOptions& options)
    : rig_(source.rig()),
      loaded_keyframes_(loaded_keyframe_ids(options)),
      map_file_(folder / "map.tfm"),
      source_(source) {
  if (!arguments.port) return;
  const auto newest_map = [this] {
    return MapSnapshot(std::make_shared<const MapSnapshot::Impl>(
        MapSnapshot::Impl{rig_, maps_.newest(), loaded_keyframes_}));
  };
  ViewerOptions viewer = viewer_options(arguments, title, source, options);
  if (arguments.control) viewer.on_command = [this](ViewCommand command) { return obey(command); };
  if (images) viewer.recorded_image = [images](std::int64_t t_ns) { return viewed_image(images(t_ns)); };
  try {
    viewer_ = std::make_unique<Viewer>(to_camera_rig(rig_), newest_map, viewer);
  } catch (const std::exception& error) {
    throw IoError("--view", error.what());
  }
  listen(options);
  print_view_addresses({.addresses = viewer_->addresses(),
                        .port = viewer_->port(),
                        .is_open_to_network = viewer_->is_open_to_network(),
                        .control = arguments.control});
}

void LiveView::listen(EngineOptions& options) {
  reporter_.listen(options);
  options.on_frame = both(options.on_frame, PoseListener([this](const PoseReport& report) { tell(report); }));
  options.on_map =
      both(options.on_map, MapListener([this](const GraphSnapshot& graph, const DoubleWindow& window) {
             maps_.publish(graph, window);
           }));
  options.on_places = both(options.on_places,
                           PlacesListener([this](const KeyframeDatabase& places) { maps_.publish(places); }));
  options.on_loop =
      both(options.on_loop, LoopListener([this](const ClosedLoop& loop) { maps_.publish(loop); }));
  options.mapping_paused = &mapping_paused_;
}

/// The tracker's thread: no lock, no allocation.
void LiveView::tell(const PoseReport& report) {
  const FrameDetails::Impl details{rig_, report, waiting()};
  reporter_.tell(
      report, [this](const MapEvent& event) { viewer_->tell(event); },
      [&](const PoseEstimate& pose) { viewer_->tell(pose, FrameDetails(details)); });
}

void LiveView::show(const MeshPieces& mesh, KeyframeId part, double voxel) {
  if (part != mesh_part_) mesh_revision_ = 0;  // the viewer forgets the part before
  mesh_part_ = part;
  viewer_->show_surface(static_cast<std::uint32_t>(part), kBlockEdge * voxel,
                        surface_pieces(mesh, mesh_revision_));
  mesh_revision_ = mesh.revision();
}

std::string LiveView::obey(ViewCommand command) {
  switch (command) {
    case ViewCommand::kSaveMap: {
      const auto map = maps_.newest();
      save_map(map_file_, rig_, map->graph, map->places);
      return fmt::format("{}, {} keyframes", map_file_.string(), live_keyframes(map->graph));
    }
    case ViewCommand::kStop:
      interrupt();
      return "the run ends as by Ctrl-C";
    case ViewCommand::kPauseMapping:
      mapping_paused_.store(true, std::memory_order_relaxed);
      return "the camera is localised, no keyframe is made";
    case ViewCommand::kResumeMapping:
      break;
  }
  mapping_paused_.store(false, std::memory_order_relaxed);
  return "mapping goes on";
}

void LiveView::show(const Frame& frame) {
  if (!viewer_) return;
  count_losses();
  if (!viewer_->wants_image()) return;
  ViewedImage image = viewed_image(frame.left);
  viewer_->show(frame.index, image.pixels, std::move(image.owner));
}

/// Recordings lose none. A report has texts, too, so that it is not asked for with each frame.
void LiveView::count_losses() {
  if (!source_.is_live() || steady_now_ns() < losses_due_ns_) return;
  losses_due_ns_ = steady_now_ns() + kLossesPeriodNs;
  viewer_->tell_lost(static_cast<std::int64_t>(source_.report().lost));
}

void LiveView::show(const Progress& progress) {
  const auto length = [](std::size_t number) { return static_cast<std::int64_t>(number); };
  frames_waiting_.store(length(progress.waiting.frames), std::memory_order_relaxed);
  keyframes_waiting_.store(length(progress.waiting.keyframes), std::memory_order_relaxed);
  places_waiting_.store(length(progress.waiting.places), std::memory_order_relaxed);
}

QueueLengths LiveView::waiting() const {
  return {frames_waiting_.load(std::memory_order_relaxed), keyframes_waiting_.load(std::memory_order_relaxed),
          places_waiting_.load(std::memory_order_relaxed)};
}

void LiveView::finish() {
  if (viewer_) viewer_->finish();
}

}  // namespace twofold
