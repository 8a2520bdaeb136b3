#pragma once

#include <CLI/App.hpp>
#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/engine.hpp"
#include "engine/options.hpp"
#include "io/sources/frame_source.hpp"
#include "io/sources/recorded_images.hpp"
#include "slam/map_lender.hpp"
#include "slam/pose_reporter.hpp"
#include "surface/mesh_pieces.hpp"
#include "twofold/viewer.hpp"

namespace twofold {

inline constexpr int kUsualViewPort = 8420;

/// What is said about the viewer on a command line.
struct ViewArguments {
  std::optional<int> port;  ///< nothing: no viewer
  std::string bind = "127.0.0.1";
  std::string secrets;   ///< ViewerOptions::secrets
  bool control = false;  ///< viewers may save the map, hold it, and end the run
};

/// --view [PORT], and --view-bind, --view-secrets and --view-control, which need it.
void add_view_options(CLI::App& command, ViewArguments& arguments);
/// For those who look at it.
[[nodiscard]] ViewedImage viewed_image(const cv::Mat& image);
/// Where a viewer can be reached.
struct ViewAddresses {
  std::vector<std::string> addresses;
  int port = 0;
  bool is_open_to_network = false;
  const char* bind_option = "--view-bind";  ///< that opened it
  bool control = false;                     ///< who looks may command
};
/// Addresses and, when others can reach them, a warning.
void print_view_addresses(const ViewAddresses& viewer);

/// The viewer of `twofold run --view`; nothing without that option.
class LiveView {
 public:
  /// Adds its listeners to those of `options`, which are called as before. `source` outlives it. Throws
  /// IoError when the port is not to be had or the program was built without the viewer.
  /// @param folder  where viewers may save the map to
  /// @param images  of frames that were played; may be empty
  LiveView(const ViewArguments& arguments, const std::string& title, const std::filesystem::path& folder,
           const FrameSource& source, const RecordedImages& images, EngineOptions& options);

  /// The reader's thread, with each frame it reads.
  void show(const Frame& frame);
  /// The same thread.
  void show(const Progress& progress);
  [[nodiscard]] bool wanted() const { return viewer_ != nullptr; }
  /// What changed in a surface's mesh since the last call. One thread.
  void show(const MeshPieces& mesh, KeyframeId part, double voxel);
  /// After the run, when the last map is there.
  void finish();

 private:
  void listen(EngineOptions& options);
  void count_losses();
  void tell(const PoseReport& report);
  [[nodiscard]] QueueLengths waiting() const;
  [[nodiscard]] std::string obey(ViewCommand command);

  const Rig rig_;
  const std::uint32_t loaded_keyframes_;
  const std::filesystem::path map_file_;
  const FrameSource& source_;
  std::int64_t losses_due_ns_ = 0;  // reader's
  PoseReporter reporter_;           // tracker's
  // As the reader saw them last; relaxed: numbers to be shown.
  std::atomic<std::int64_t> frames_waiting_{-1}, keyframes_waiting_{-1}, places_waiting_{-1};
  MapLender maps_;
  std::atomic<bool> mapping_paused_{false};  // relaxed: a wish
  std::uint64_t mesh_revision_ = 0;          // of the mesh that was shown
  KeyframeId mesh_part_ = kNoKeyframe;
  std::unique_ptr<Viewer> viewer_;
};

}  // namespace twofold
