#include "io/sources/raw_folder_source.hpp"

#include <map>
#include <set>

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

/// Files of a single camera. Two cameras' images that lie in one folder would be calibrated as one.
void expect_one_camera(const fs::path& folder) {
  std::set<std::string> names;
  for (const fs::path& file : list_images(folder)) names.insert(file.stem());
  for (const std::string& name : names) {
    const auto at = name.find("left");
    if (at == std::string::npos) continue;
    const std::string partner = std::string(name).replace(at, 4, "right");
    if (names.contains(partner))
      throw IoError(
          folder,
          fmt::format("holds the images of two cameras ({}, {}): move them into folders left/ and right/",
                      name, partner));
  }
}

}  // namespace

RawFolderSource::RawFolderSource(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw IoError(folder, "no such folder");
  const Layout layout = layout_of(folder);
  const bool stereo = !layout.right.empty();
  if (!stereo) expect_one_camera(layout.left);
  std::map<std::string, fs::path> right;
  if (stereo) {
    for (const fs::path& file : list_images(layout.right)) right[file.stem()] = file;
  }
  for (const fs::path& file : list_images(layout.left)) {
    const auto partner = right.find(file.stem());
    if (stereo && partner == right.end()) {
      ++unpaired_;
      continue;
    }
    pairs_.push_back({file, stereo ? partner->second : fs::path()});
  }
  unpaired_ += stereo ? right.size() - pairs_.size() : 0;
  if (pairs_.empty()) throw IoError(folder, "no image of the left camera has a partner of the same name");
  const cv::Mat first = read_grey_image(pairs_[0].left);
  rig_.kind = stereo ? SensorKind::kStereo : SensorKind::kMono;
  rig_.camera.width = first.cols;
  rig_.camera.height = first.rows;
}

std::optional<std::int64_t> RawFolderSource::frame_count() const {
  return static_cast<std::int64_t>(pairs_.size());
}

SourceReport RawFolderSource::report() const {
  SourceReport report;
  if (unpaired_ > 0)
    report.notes.push_back(
        fmt::format("{} images without a partner of the same name are left out", unpaired_));
  return report;
}

bool RawFolderSource::read(Frame& frame) {
  if (next_ == pairs_.size()) return false;
  const Files& files = pairs_[next_];
  frame = Frame();
  frame.index = static_cast<std::int64_t>(next_);
  frame.t_ns = static_cast<std::int64_t>(next_);
  frame.left = read_grey_image(files.left);
  expect_size(files.left, frame.left, rig_.camera, size_of_image(pairs_[0].left));
  if (rig_.kind == SensorKind::kStereo) {
    frame.right = read_grey_image(files.right);
    expect_size(files.right, frame.right, rig_.camera, size_of_image(pairs_[0].left));
  }
  ++next_;
  return true;
}

}  // namespace twofold
