#include "apps/twofold/view/run_files.hpp"

#include <algorithm>
#include <fstream>
#include <map>
#include <string>

#include <fmt/format.h>

#include "apps/twofold/map_parts.hpp"

namespace twofold {
namespace {

/// Lines of edges.txt (graph_export.hpp).
std::vector<ViewEdge> read_edges(const std::filesystem::path& file, const std::vector<std::uint32_t>& ids) {
  std::vector<ViewEdge> edges;
  std::ifstream in(file);  // runs before there were such files have none
  std::size_t from = 0, to = 0;
  ViewEdge edge;
  std::string kind;
  while (in >> from >> to >> edge.shared_points >> kind) {
    if (from >= ids.size() || to >= ids.size() || from >= to)
      throw IoError(file.string(), "names a keyframe there is not");
    edge.from = ids[from];
    edge.to = ids[to];
    edge.marginalised = kind == "marginalised" ? 1 : 0;
    edges.push_back(edge);
  }
  if (in.is_open() && !in.eof())
    throw IoError(file.string(), fmt::format("line {} makes no sense", edges.size() + 1));
  return edges;
}

/// Keyframes of all parts: the loaded map's as they come, then the run's by their times, of which two parts
/// may not share one.
void number_keyframes(std::vector<RunPart>& parts) {
  std::uint32_t next = 0;
  std::map<std::int64_t, std::uint32_t> numbers;
  for (RunPart& part : parts) {
    for (std::size_t k = 0; k < part.loaded; ++k) part.ids.push_back(next++);
    for (const TimedPose& keyframe : part.own_keyframes()) numbers.emplace(keyframe.t_ns, 0);
  }
  for (auto& [t_ns, number] : numbers) number = next++;
  for (RunPart& part : parts)
    for (const TimedPose& keyframe : part.own_keyframes()) part.ids.push_back(numbers.at(keyframe.t_ns));
}

/// Of whatever recordings: a map that was gone on with twice has keyframes of two.
Trajectory read_loaded_keyframes(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) return {};
  return read_tum_trajectory(file, {.order = TimeOrder::kAny});
}

}  // namespace

std::vector<RunPart> read_run_parts(const std::filesystem::path& folder) {
  const auto file = [&](const char* stem, std::size_t n, const char* extension) {
    return folder / part_file(stem, n, extension);
  };
  std::vector<RunPart> parts;
  for (std::size_t n = 0; n == 0 || std::filesystem::exists(file("trajectory", n, ".txt")); ++n) {
    RunPart& part = parts.emplace_back();
    part.poses = read_tum_trajectory(file("trajectory", n, ".txt"));
    part.keyframes = read_loaded_keyframes(file("keyframes_loaded", n, ".txt"));
    part.loaded = part.keyframes.size();
    const Trajectory own = read_tum_trajectory(file("keyframes", n, ".txt"));
    part.keyframes.insert(part.keyframes.end(), own.begin(), own.end());
    part.points = read_ply(file("map", n, ".ply"));
  }
  number_keyframes(parts);
  for (std::size_t n = 0; n < parts.size(); ++n)
    parts[n].edges = read_edges(file("edges", n, ".txt"), parts[n].ids);
  return parts;
}

RunJson read_run_json(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw IoError(file.string(), "is missing: is this the output folder of a run?");
  RunJson json = RunJson::parse(in, nullptr, false);
  if (!json.is_object()) throw IoError(file.string(), "is no JSON");
  return json;
}

}  // namespace twofold
