#include "io/sources/layouts/recognise_layout.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/layouts/numbered_frames.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// The order of these questions decides: a folder may have files of several layouts.
std::optional<std::string> layout_in(const fs::path& folder) {
  const auto has = [&](const fs::path& name) {
    std::error_code ignored;
    return fs::exists(folder / name, ignored);
  };
  // Before EuRoC's: a rendered RGB-D recording has its images in mav0, where nothing tells of their depth.
  if (has("associations.txt")) return "tum";
  if (has("mav0") || has(fs::path("cam0") / "data.csv")) return "euroc";
  if (has("image_0") || has("image_2")) return "kitti";
  if (has("rgb.txt") || has("color.txt")) return "tum";
  // Before a folder of images: theirs are of both kinds.
  if (is_seven_scenes(folder)) return "7scenes";
  if (is_replica(folder)) return "replica";
  if (is_scannet(folder)) return "scannet";
  if (has("times.txt") || has("left") || has("calibration.yaml")) return "images";
  return std::nullopt;
}

/// Names of what is in a folder, of the kind asked for; the first of very many.
std::vector<std::string> names_in(const fs::path& folder, bool (*wanted)(const fs::path&)) {
  constexpr std::size_t kMost = 10'000;
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (names.size() == kMost) break;
    if (wanted(entry.path())) names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

bool is_folder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

bool is_archive(const fs::path& path) {
  static constexpr std::array<std::string_view, 10> kEnds{".zip", ".tgz", ".tar",  ".gz", ".bz2",
                                                          ".xz",  ".zst", ".zstd", ".7z", ".rar"};
  return std::find(kEnds.begin(), kEnds.end(), path.extension().string()) != kEnds.end();
}

bool is_sqlite_bag(const fs::path& path) {
  return path.extension() == ".db3";
}

bool is_bag(const fs::path& path) {
  return path.extension() == ".mcap" || path.extension() == ".bag";
}

std::string sqlite_bag_advice(const fs::path& bag) {
  return fmt::format(
      "is a ROS 2 bag in SQLite's form, which is not read: 'mcap convert {} {}' or 'ros2 bag "
      "convert' makes an MCAP file of it (docs/sources.md)",
      bag.filename().string(), bag.filename().replace_extension(".mcap").string());
}

/// What to give instead of a folder of bags, as ROS 2 makes one for each; empty: it is none.
std::string bag_folder_advice(const fs::path& folder) {
  const auto one_of = [](const std::vector<std::string>& bags) {
    return bags.size() == 1 ? fmt::format("is no recording, but {} in it is: give that file", bags[0])
                            : fmt::format("is no recording, but has {} in it: give one of them, as {}",
                                          bags.size(), bags[0]);
  };
  if (const auto bags = names_in(folder, is_bag); !bags.empty()) return one_of(bags);
  if (const auto bags = names_in(folder, is_sqlite_bag); !bags.empty())
    return fmt::format("{} in it {}", bags[0], sqlite_bag_advice(bags[0]));
  std::error_code ignored;
  if (!fs::exists(folder / "metadata.yaml", ignored)) return {};
  if (const auto archives = names_in(folder, is_archive); !archives.empty())
    return fmt::format("is a ROS 2 bag's folder, whose bag is packed, as {}: unpack it", archives[0]);
  return "is a ROS 2 bag's folder without the bag: its .mcap file is missing";
}

/// Recordings in a folder, or, where it has none, in the folders in it (dataset/sequences/00).
std::vector<std::string> recordings_in(const fs::path& folder, int levels) {
  const std::vector<std::string> folders = names_in(folder, is_folder);
  std::vector<std::string> found;
  for (const std::string& name : folders)
    if (layout_in(folder / name)) found.push_back(name);
  for (auto name = folders.begin(); found.empty() && levels > 1 && name != folders.end(); ++name)
    for (const std::string& inner : recordings_in(folder / *name, levels - 1))
      found.push_back(*name + "/" + inner);
  return found;
}

/// The folder above that is a recording, of which this one is a part (mav0/cam0, sequences/00/image_0).
std::optional<fs::path> recording_around(const fs::path& folder) {
  fs::path above = (fs::absolute(folder) / "").lexically_normal().parent_path();
  for (int level = 0; level < 3 && above.has_relative_path(); ++level) {
    above = above.parent_path();
    const auto layout = layout_in(above);
    if (layout && *layout != "images") return above;
  }
  return std::nullopt;
}

bool is_image(const fs::path& path) {
  static constexpr std::array<std::string_view, 3> kEnds{".png", ".jpg", ".jpeg"};
  return std::find(kEnds.begin(), kEnds.end(), path.extension().string()) != kEnds.end();
}

/// What to give instead of a folder that is no recording.
std::string advice_for(const fs::path& folder) {
  constexpr int kLevels = 2;
  if (const std::string advice = bag_folder_advice(folder); !advice.empty()) return advice;
  if (std::error_code ignored;
      fs::exists(folder / "summary.json", ignored) && fs::exists(folder / "trajectory.txt", ignored))
    return "is the output folder of a run: give the run's source, or, for eval, a trajectory in it "
           "(groundtruth.txt)";
  if (is_folder(folder / "image_00" / "data"))
    return "is of KITTI's raw data, which is not read whole: 'images:DIR/image_00/data?fps=10&fx=..' runs "
           "one camera of it, KITTI odometry has many of these drives as pairs";
  if (const auto found = recordings_in(folder, kLevels); found.size() == 1)
    return fmt::format("is no recording, but {} in it is: give that folder", found[0]);
  else if (!found.empty())
    return fmt::format("is no recording, but has {} in it: give one of them, as {}", found.size(), found[0]);
  if (const auto around = recording_around(folder))
    return fmt::format("is a part of a recording: give {}", around->string());
  if (const auto archives = names_in(folder, is_archive); !archives.empty())
    return fmt::format("has archives in it, as {}: unpack them, and give the folder of a recording",
                       archives[0]);
  if (!names_in(folder, is_image).empty())
    return "has images, but nothing says when they were taken: 'images:DIR?fps=N', or a times.txt";
  return "no known layout (docs/sources.md has them); a folder of images: images:DIR?fps=N";
}

}  // namespace

void expect_folder(const fs::path& folder) {
  std::error_code error;
  if (!fs::exists(folder, error)) throw IoError(folder, "no such folder");
  if (!fs::is_directory(folder, error)) throw IoError(folder, "is not a folder");
  if (fs::is_empty(folder, error) || error)
    throw IoError(folder, error ? "cannot be read" : "the folder is empty");
}

void expect_no_sqlite_bag(const fs::path& file) {
  if (is_sqlite_bag(file)) throw IoError(file, sqlite_bag_advice(file));
}

std::string recognise_layout(const fs::path& path) {
  std::error_code error;
  if (fs::is_regular_file(path, error)) {
    if (is_archive(path)) throw IoError(path, "is an archive: unpack it, and give the recording's folder");
    expect_no_sqlite_bag(path);
    return path.extension() == ".mcap" ? "mcap" : path.extension() == ".bag" ? "bag" : "video";
  }
  if (fs::is_character_file(path, error)) return "v4l2";
  if (!fs::exists(path, error)) throw IoError(path, "no such file or folder");
  expect_folder(path);
  if (const auto layout = layout_in(path)) return *layout;
  throw IoError(path, advice_for(path));
}

}  // namespace twofold
