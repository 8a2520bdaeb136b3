#include "engine/checkpoint_writer.hpp"

#include <algorithm>

#include "engine/clock.hpp"
#include "graph/map_file.hpp"

namespace twofold {

void CheckpointWriter::save(const GraphSnapshot& graph, const KeyframeDatabase& places) {
  if (graph.version() == report_.version) return;
  const std::int64_t begin_ns = steady_now_ns();
  try {
    save_map(options_.file, rig_, graph, places);
  } catch (const MapFileError& error) {
    report_.error = error.what();
    return;
  }
  ++report_.saved;
  report_.version = graph.version();
  report_.longest_ns = std::max(report_.longest_ns, steady_now_ns() - begin_ns);
}

}  // namespace twofold
