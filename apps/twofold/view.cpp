#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>

#include "apps/twofold/commands.hpp"
#include "apps/twofold/interrupt.hpp"
#include "apps/twofold/live_view.hpp"
#include "apps/twofold/map_options.hpp"
#include "apps/twofold/view/finished_run.hpp"
#include "apps/twofold/view/run_files.hpp"
#include "engine/clock.hpp"
#include "io/files/io_error.hpp"
#include "io/files/mesh_file.hpp"
#include "io/sources/recorded_images.hpp"
#include "slam/conversions.hpp"
#include "slam/map_snapshot.hpp"
#include "slam/surface_pieces.hpp"
#include "twofold/frame_details.hpp"
#include "viewer/keyframe_images.hpp"
#include "viewer/server.hpp"

namespace twofold {
namespace {

struct FileViewArguments {
  std::string path;
  ViewServerOptions server{.port = kUsualViewPort};
};

/// Until the program is interrupted.
void serve(const ViewServerOptions& options, const ViewScene& scene, const ViewTitle& title,
           KeyframeImages images) {
  std::unique_ptr<ViewServer> server;
  try {
    server = std::make_unique<ViewServer>(options, scene, title);
  } catch (const std::runtime_error& error) {
    throw IoError("view", error.what());
  }
  print_view_addresses({.addresses = server->addresses(),
                        .port = server->port(),
                        .is_open_to_network = server->is_open_to_network(),
                        .bind_option = "--bind"});
  catch_interrupts();
  std::stop_source stop;
  const auto watch = [&](const ViewServer::Audience& audience, ViewSight& newest) {
    images.answer(audience.keyframes, steady_now_ns(), newest);
    if (interrupted().load(std::memory_order_relaxed))
      stop.request_stop();  // relaxed: the flag carries no other data
    return std::nullopt;
  };
  server->run(stop.get_token(), watch, [] { return std::string("the program has ended"); });
}

/// Of the run's recording, or of the one that it was made of.
RecordedImages recorded_images(const RunJson& summary) {
  const RunJson recording = summary.value("recording", RunJson());
  if (recording.is_string()) return images_of_recording("euroc:" + recording.get<std::string>(), {});
  std::optional<std::filesystem::path> calibration;
  if (const RunJson file = summary.value("calibration_file", RunJson()); file.is_string())
    calibration = file.get<std::string>();
  return images_of_recording(summary.value("source", ""), calibration);
}

/// Images of a run's keyframes, from what it recorded or else from the recording it was made of; empty when
/// that is not to be had any more, or is no folder of images.
KeyframeImages::Find images_of_run(const std::filesystem::path& folder) {
  try {
    const RecordedImages images = recorded_images(read_run_json(folder / "summary.json"));
    if (!images) return {};
    std::map<std::uint32_t, std::int64_t> t_ns;
    for (const RunPart& part : read_run_parts(folder))
      for (std::size_t k = part.loaded; k < part.ids.size(); ++k)
        t_ns.emplace(part.ids[k], part.keyframes[k].t_ns);
    return [images, t_ns](std::uint32_t keyframe) {
      const auto at = t_ns.find(keyframe);
      return at != t_ns.end() ? viewed_image(images(at->second)) : ViewedImage();
    };
  } catch (
      const std::runtime_error&) {  // moved, deleted, or in need of a calibration that only the run was given
    return {};
  }
}

/// The path of a map file is that of its keyframes.
void show_map_file(const std::filesystem::path& file, ViewScene& scene, ViewTitle& title) {
  constexpr std::size_t kFewPoints = 300'000;  // more would take seconds to find the covariances of
  SavedMap saved = open_map(file.string());
  auto version = std::make_shared<MapVersion>();
  version->graph = std::move(saved.graph);
  version->places = std::move(saved.places);
  title.rig = to_camera_rig(saved.rig);
  title.kind = ViewKind::kMap;
  title.title = file.filename().string();
  title.metres = saved.rig.kind != SensorKind::kMono;
  title.has_times = false;
  title.has_deviations = version->graph.point_count() < kFewPoints;
  const MapSnapshot map(std::make_shared<const MapSnapshot::Impl>(MapSnapshot::Impl{saved.rig, version}));
  std::int64_t start_ns = 0;
  if (const auto keyframes = map.keyframes(); !keyframes.empty()) start_ns = keyframes.front().t_ns;
  scene.begin(start_ns);
  const ViewMap view = view_of(map, start_ns, title.has_deviations);
  scene.show(view);
  for (std::uint32_t n = 0; const ViewKeyframe& keyframe : view.keyframes) {
    ViewPathFrame frame;
    frame.frame = n++;
    frame.t = keyframe.t;
    frame.reference = keyframe.id;
    frame.part = keyframe.part;
    frame.keyframe = 1;
    std::copy_n(keyframe.position, 3, frame.causal);
    scene.add(frame);
  }
}

/// The mesh that `run --surface` or `twofold surface` left, if there is one.
void show_surface_of_run(const std::filesystem::path& folder, ViewScene& scene) {
  constexpr double kCells = 48;  // along the mesh's longest side
  const std::filesystem::path file = folder / "surface.ply";
  if (!std::filesystem::is_regular_file(file)) return;
  const SurfaceMesh mesh = to_surface_mesh(read_ply_mesh(file));
  std::array<float, 3> low{}, high{};
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = v == 0 ? mesh.positions[v][a] : std::min(low[a], mesh.positions[v][a]);
      high[a] = v == 0 ? mesh.positions[v][a] : std::max(high[a], mesh.positions[v][a]);
    }
  }
  const float side = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  if (!(side > 0)) return;
  const std::vector<RunPart> parts = read_run_parts(folder);
  const double edge = side / kCells;
  scene.surface().show(parts.empty() ? 0 : parts.front().name(), edge, cut_into_pieces(mesh, edge));
}

void view(const FileViewArguments& arguments) {
  ViewScene scene;
  ViewTitle title;
  KeyframeImages::Find images;
  if (std::filesystem::is_directory(arguments.path)) {
    show_finished_run(arguments.path, scene, title);
    show_surface_of_run(arguments.path, scene);
    images = images_of_run(arguments.path);
    title.keyframe_images = static_cast<bool>(images);
    title.efforts = effort_levels();
  } else {
    show_map_file(arguments.path, scene, title);
  }
  serve(arguments.server, scene, title, KeyframeImages(std::move(images)));
}

}  // namespace

void add_view_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<FileViewArguments>();
  CLI::App* command = app.add_subcommand("view", "Show a map file or a finished run in a browser");
  command->add_option("PATH", arguments->path, "Map file (.tfm) or output folder of `twofold run`")
      ->required();
  command->add_option("--port", arguments->server.port, "Port to listen at; 0: any that is free")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command
      ->add_option("--bind", arguments->server.bind,
                   "Address to listen on: any but a loopback address shows it to the network; 0.0.0.0: all "
                   "of the machine's")
      ->capture_default_str();
  command->add_option(
      "--secrets", arguments->server.secrets,
      "File that keeps the address's token, so that it stays the same; made when it is not there");
  command->callback([arguments, &exit_code] {
    view(*arguments);
    exit_code = kOk;
  });
}

}  // namespace twofold
