#include "apps/twofold/live_view.hpp"

#include <CLI/CLI.hpp>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "slam/conversions.hpp"
#include "slam/map_snapshot.hpp"
#include "tracking/track_result.hpp"

namespace twofold {
namespace {

ViewerOptions viewer_options(const ViewArguments& arguments, const std::string& title,
                             const FrameSource& source) {
  ViewerOptions options;
  options.title = title;
  options.bind = arguments.bind;
  options.port = *arguments.port;
  for (std::size_t s = 0; s < kTrackerStages; ++s)
    options.stages.emplace_back(describe(static_cast<TrackerStage>(s)));
  for (const TimedPose& pose : source.ground_truth()) {
    options.truth.push_back(to_pose(pose.T_w_c));
    options.truth_t_ns.push_back(pose.t_ns);
  }
  return options;
}

/// Calls both, of which the first may be empty.
template <class... Arguments>
std::function<void(Arguments...)> both(std::function<void(Arguments...)> first,
                                       std::function<void(Arguments...)> second) {
  if (!first) return second;
  return [first = std::move(first), second = std::move(second)](Arguments... arguments) {
    first(arguments...);
    second(arguments...);
  };
}

}  // namespace

void add_view_options(CLI::App& command, ViewArguments& arguments, const std::string& description) {
  command
      .add_option_function<int>(
          "--view", [&arguments](const int& port) { arguments.port = port; }, description)
      ->expected(0, 1)
      ->default_str(std::to_string(kUsualViewPort))
      ->check(CLI::Range(0, 65535))
      ->type_name("[PORT]");
  command
      .add_option("--view-bind", arguments.bind,
                  "Address to listen on: any but 127.0.0.1 shows camera and map to the network")
      ->capture_default_str();
}

void print_view_address(const std::string& address, bool is_open_to_network) {
  fmt::print(stderr, "view at     {}\n", address);
  if (is_open_to_network) {
    fmt::print(
        stderr,
        "note        whoever reaches this machine and sees this address sees the camera, unencrypted; safer: "
        "no --view-bind, and `ssh -L {0}:localhost:{0} THIS_MACHINE` from there\n",
        kUsualViewPort);
  }
}

LiveView::LiveView(const ViewArguments& arguments, const std::string& title, const FrameSource& source,
                   EngineOptions& options) {
  if (!arguments.port) return;
  const auto newest_map = [this, rig = source.rig()] {
    return MapSnapshot(std::make_shared<const MapSnapshot::Impl>(MapSnapshot::Impl{rig, maps_.newest()}));
  };
  try {
    viewer_ = std::make_unique<Viewer>(to_camera_rig(source.rig()), newest_map,
                                       viewer_options(arguments, title, source));
  } catch (const std::runtime_error& error) {
    throw IoError("--view", error.what());
  }
  listen(options);
  print_view_address(viewer_->address(), viewer_->is_open_to_network());
}

void LiveView::listen(EngineOptions& options) {
  options.on_pose = both(options.on_pose, PoseListener([this](const PoseReport& report) {
                           PoseReporter::Events events;
                           const PoseEstimate pose = reporter_.next(report, events);
                           if (events.correction) viewer_->tell(*events.correction);
                           if (events.placing) viewer_->tell(*events.placing);
                           viewer_->tell(pose, report.stage_ns);
                         }));
  options.on_map =
      both(options.on_map, MapListener([this](const GraphSnapshot& graph, const DoubleWindow& window) {
             maps_.publish(graph, window);
           }));
  options.on_places = both(options.on_places,
                           PlacesListener([this](const KeyframeDatabase& places) { maps_.publish(places); }));
}

void LiveView::show(const Frame& frame) {
  if (!viewer_ || !viewer_->wants_image()) return;
  const auto owner = std::make_shared<const cv::Mat>(frame.left);
  viewer_->show(frame.index,
                {owner->data, owner->cols, owner->rows, static_cast<std::ptrdiff_t>(owner->step), {}}, owner);
}

void LiveView::finish() {
  if (viewer_) viewer_->finish();
}

}  // namespace twofold
