#include "apps/twofold/map_parts.hpp"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "graph/part_extraction.hpp"

namespace twofold {

std::vector<MapPart> map_parts(const RunResult& result, const EngineOptions& options) {
  const GraphSnapshot& graph = result.graph;
  std::map<KeyframeId, MapPart> found;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.culled()) continue;
    MapPart& part = found[keyframe.part];
    part.id = keyframe.part;
    ++part.keyframes;
  }
  for (const FrameRecord& record : result.frames) {
    if (!has_final_pose(record, graph)) continue;
    found[graph.part(record.reference)].trajectory.push_back(
        {record.t_ns, final_T_c_w(record, graph).inverse()});
  }
  std::vector<MapPart> parts;
  for (auto& [id, part] : found) parts.push_back(std::move(part));
  if (parts.empty()) parts.emplace_back();
  const KeyframeId loaded = options.map ? oldest_part(graph) : kNoKeyframe;
  std::stable_sort(parts.begin(), parts.end(), [&](const MapPart& a, const MapPart& b) {
    if (a.id == loaded || b.id == loaded) return a.id == loaded && b.id != loaded;
    return a.trajectory.size() > b.trajectory.size();
  });
  return parts;
}

std::vector<std::string> save_parts(const std::filesystem::path& file, const Rig& rig,
                                    const RunResult& result, const std::vector<MapPart>& parts) {
  std::vector<std::string> written;
  for (const MapPart& part : parts) {
    if (!written.empty() && part.keyframes < 2) continue;
    const std::filesystem::path to = part_file(file, written.size());
    if (parts.size() == 1) {
      save_map(to, rig, result.graph, result.places);
    } else {
      save_map(to, extract_part(rig, result.graph, result.places, part.id));
    }
    written.push_back(to.string());
  }
  return written;
}

std::string part_file(const std::string& stem, std::size_t n, const std::string& extension) {
  return n == 0 ? stem + extension : fmt::format("{}-{}{}", stem, n + 1, extension);
}

std::filesystem::path part_file(const std::filesystem::path& file, std::size_t n) {
  return file.parent_path() / part_file(file.stem().string(), n, file.extension().string());
}

}  // namespace twofold
