#include "engine/checkpoint_writer.hpp"

#include <algorithm>
#include <utility>

#include "engine/clock.hpp"
#include "engine/thrown.hpp"
#include "graph/map_file.hpp"

namespace twofold {

CheckpointWriter::CheckpointWriter(const Rig& rig, CheckpointOptions options, Save save)
    : rig_(rig), options_(std::move(options)), save_(std::move(save)) {}

void CheckpointWriter::save_whole_map(const std::filesystem::path& file, const Rig& rig,
                                      const GraphSnapshot& graph, const KeyframeDatabase& places) {
  save_map(file, rig, graph, places);
}

std::string CheckpointWriter::newest_error() const {
  const std::scoped_lock lock(lock_);
  return newest_error_;
}

void CheckpointWriter::set_newest_error(std::string error) {
  const std::scoped_lock lock(lock_);
  newest_error_ = std::move(error);
}

void CheckpointWriter::save(const GraphSnapshot& graph, const KeyframeDatabase& places) {
  if (graph.version() == report_.version) return;
  const std::int64_t begin_ns = steady_now_ns();
  try {
    save_(options_.file, rig_, graph, places);
  } catch (...) {
    report_.error = what_was_thrown();
    set_newest_error(report_.error);
    return;
  }
  set_newest_error("");
  ++report_.saved;
  report_.version = graph.version();
  report_.longest_ns = std::max(report_.longest_ns, steady_now_ns() - begin_ns);
}

}  // namespace twofold
