#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "apps/twofold/commands.hpp"
#include "apps/twofold/graph_export.hpp"
#include "apps/twofold/map_options.hpp"
#include "apps/twofold/map_parts.hpp"
#include "graph/part_extraction.hpp"
#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"
#include "io/files/ply.hpp"
#include "io/files/trajectory_file.hpp"

namespace twofold {
namespace {

const char* name_of(SensorKind kind) {
  return kind == SensorKind::kStereo ? "stereo" : kind == SensorKind::kRgbd ? "rgbd" : "mono";
}

void print_info(const std::string& file) {
  const SavedMap map = open_map(file);
  const GraphSnapshot& graph = map.graph;
  const std::size_t keyframes = live_keyframes(graph);
  std::size_t points = 0, observations = 0, edges = 0, marginalised = 0;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    observations += keyframe.observations->size();
    for (const Edge& edge : *keyframe.edges) {
      if (edge.other > keyframe.id) continue;
      ++edges;
      marginalised += edge.marginalised ? 1 : 0;
    }
  }
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) points += graph.point(PointId{p}).culled() ? 0 : 1;
  std::size_t places = 0, corners = 0;
  for (std::uint32_t k = 0; k < map.places.size(); ++k) {
    const PlaceAppearance* place = map.places.find(KeyframeId{k});
    places += place != nullptr ? 1 : 0;
    corners += place != nullptr ? place->corners.size() : 0;
  }
  const PinholeCamera& camera = map.rig.camera;
  fmt::print("sensor        {} {}x{}, f {:.2f} {:.2f}, c {:.2f} {:.2f}, baseline {:.4f} m\n",
             name_of(map.rig.kind), camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy,
             map.rig.baseline);
  fmt::print("keyframes     {} ({} culled)\npoints        {} ({} culled)\nobservations  {}\n", keyframes,
             graph.keyframe_count() - keyframes, points, graph.point_count() - points, observations);
  if (const auto parts = parts_of(graph); parts.size() > 1)
    fmt::print("parts         {}, not connected\n", parts.size());
  fmt::print("edges         {} ({} marginalised)\nplaces        {} ({} corners)\nfile          {} bytes\n",
             edges, marginalised, places, corners, std::filesystem::file_size(file));
}

struct ExportArguments {
  std::string file, ply, g2o, tum;
};

/// None of them is written over another.
void expect_distinct(const std::vector<std::filesystem::path>& files) {
  for (std::size_t i = 0; i < files.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (!files[i].empty() &&
          std::filesystem::weakly_canonical(files[i]) == std::filesystem::weakly_canonical(files[j]))
        throw IoError(files[i], "is named twice: every file needs a name of its own");
}

void export_map(const ExportArguments& arguments) {
  if (arguments.ply.empty() && arguments.g2o.empty() && arguments.tum.empty()) {
    throw IoError("map export", "name at least one of --ply, --g2o, --tum");
  }
  expect_distinct({arguments.file, arguments.ply, arguments.g2o, arguments.tum});
  const SavedMap map = open_map(arguments.file);
  std::vector<KeyframeId> parts = parts_of(map.graph);
  if (parts.empty()) parts.push_back(KeyframeId{0});  // of an empty map: files with nothing in them
  std::vector<MapSnapshot::Point> points;
  if (!arguments.ply.empty()) points = points_with_covariance(map.rig, map.graph);
  const LengthUnit unit = map.rig.kind == SensorKind::kMono ? LengthUnit::kArbitrary : LengthUnit::kMetre;
  for (std::size_t n = 0; n < parts.size(); ++n) {
    if (!arguments.ply.empty())
      write_ply(part_file(std::filesystem::path(arguments.ply), n), map_points(points, map.graph, parts[n]),
                unit);
    if (!arguments.tum.empty())
      write_tum_trajectory(part_file(std::filesystem::path(arguments.tum), n),
                           keyframe_trajectory(map.graph, parts[n]));
  }
  if (!arguments.g2o.empty()) write_file(arguments.g2o, g2o_text(map.graph));
}

}  // namespace

void add_map_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("map", "Map files (.tfm): look into, check, export");
  command->require_subcommand(1);
  auto arguments = std::make_shared<ExportArguments>();
  CLI::App* info = command->add_subcommand("info", "What the map holds");
  info->add_option("FILE", arguments->file, "map file")->required();
  info->callback([arguments, &exit_code] {
    print_info(arguments->file);
    exit_code = kOk;
  });
  CLI::App* check =
      command->add_subcommand("check", "Read all of it; exit code 2 and the section when damaged");
  check->add_option("FILE", arguments->file, "map file")->required();
  check->callback([arguments, &exit_code] {
    (void)open_map(arguments->file);
    fmt::print("{}: intact\n", arguments->file);
    exit_code = kOk;
  });
  CLI::App* out = command->add_subcommand("export", "Write parts of it in common forms");
  out->add_option("FILE", arguments->file, "map file")->required();
  out->add_option("--ply", arguments->ply,
                  "points, a file for each part: FILE, then its name with -2, -3, ...");
  out->add_option("--g2o", arguments->g2o,
                  "keyframe poses and edges (VERTEX_SE3:QUAT, EDGE_SE3:QUAT); an edge's information is the "
                  "number of points that both keyframes see, times the identity");
  out->add_option("--tum", arguments->tum, "keyframe poses, a file for each part");
  out->callback([arguments, &exit_code] {
    export_map(*arguments);
    exit_code = kOk;
  });
}

}  // namespace twofold
