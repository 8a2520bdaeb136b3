#pragma once

#include <filesystem>
#include <functional>
#include <mutex>
#include <string>

#include "camera/rig.hpp"
#include "engine/options.hpp"
#include "engine/result.hpp"
#include "graph/keyframe_database.hpp"
#include "graph/snapshot.hpp"

namespace twofold {

/// Saves published versions of a map to one file, whole each time (save_map). Used by one thread, but for
/// newest_error; the report is read after that was joined. A save that fails, whatever it throws, is
/// reported, and the next one tries again: a full disk must not end a run.
class CheckpointWriter {
 public:
  using Save = std::function<void(const std::filesystem::path&, const Rig&, const GraphSnapshot&,
                                  const KeyframeDatabase&)>;
  /// save: save_map, but for tests.
  CheckpointWriter(const Rig& rig, CheckpointOptions options, Save save = save_whole_map);

  [[nodiscard]] bool enabled() const { return options_.period > 0; }
  [[nodiscard]] std::int64_t period_ns() const { return static_cast<std::int64_t>(options_.period * 1e9); }

  /// Reads both through these references only. Nothing is written when this version of the graph was saved
  /// before.
  void save(const GraphSnapshot& graph, const KeyframeDatabase& places);

  [[nodiscard]] const CheckpointReport& report() const { return report_; }
  /// Why the newest save failed; empty: it did not. Any thread.
  [[nodiscard]] std::string newest_error() const;

 private:
  static void save_whole_map(const std::filesystem::path& file, const Rig& rig, const GraphSnapshot& graph,
                             const KeyframeDatabase& places);
  void set_newest_error(std::string error);

  Rig rig_;
  CheckpointOptions options_;
  Save save_;
  CheckpointReport report_;
  mutable std::mutex lock_;  // guards newest_error_
  std::string newest_error_;
};

}  // namespace twofold
