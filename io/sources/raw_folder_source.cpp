#include "io/sources/raw_folder_source.hpp"

#include <map>

#include <fmt/format.h>

#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

struct Layout {
  fs::path left, right;  // right: empty for a single camera
};

Layout layout_of(const fs::path& folder) {
  for (const fs::path& root : {folder / "mav0", folder}) {
    if (!fs::is_directory(root / "cam0/data")) continue;
    return {root / "cam0/data", fs::is_directory(root / "cam1/data") ? root / "cam1/data" : fs::path()};
  }
  if (!fs::is_directory(folder / "left")) return {folder, {}};
  return {folder / "left", fs::is_directory(folder / "right") ? folder / "right" : fs::path()};
}

}  // namespace

RawFolderSource::RawFolderSource(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw IoError(folder, "no such folder");
  const Layout layout = layout_of(folder);
  const bool stereo = !layout.right.empty();
  std::map<std::string, fs::path> right;
  if (stereo) {
    for (const fs::path& file : list_images(layout.right)) right[file.stem()] = file;
  }
  for (const fs::path& file : list_images(layout.left)) {
    const auto partner = right.find(file.stem());
    if (stereo && partner == right.end()) continue;
    pairs_.push_back({file, stereo ? partner->second : fs::path()});
  }
  if (pairs_.empty()) throw IoError(folder, "no image of the left camera has a partner of the same name");
  const cv::Mat first = read_grey_image(pairs_[0].left);
  rig_.kind = stereo ? SensorKind::kStereo : SensorKind::kMono;
  rig_.camera.width = first.cols;
  rig_.camera.height = first.rows;
}

std::optional<std::int64_t> RawFolderSource::frame_count() const {
  return static_cast<std::int64_t>(pairs_.size());
}

bool RawFolderSource::read(Frame& frame) {
  if (next_ == pairs_.size()) return false;
  const Files& files = pairs_[next_];
  frame = Frame();
  frame.index = static_cast<std::int64_t>(next_);
  frame.t_ns = static_cast<std::int64_t>(next_);
  frame.left = read_grey_image(files.left);
  expect_size(files.left, frame.left, rig_.camera);
  if (rig_.kind == SensorKind::kStereo) {
    frame.right = read_grey_image(files.right);
    expect_size(files.right, frame.right, rig_.camera);
  }
  ++next_;
  return true;
}

}  // namespace twofold
