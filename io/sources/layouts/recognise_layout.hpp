#pragma once

#include <filesystem>
#include <string>

namespace twofold {

/// The scheme of a source given by its bare path, from what is there: a recording's folder, by the first of
/// those lists and folders that it has; a video, a recording of ROS, a camera.
///
/// Throws IoError when that is none of them. Where people often point beside a recording, at an archive, at
/// a dataset's folder of sequences, at a part of a recording, it says what to give instead.
[[nodiscard]] std::string recognise_layout(const std::filesystem::path& path);

/// Throws IoError for ROS 2's bags in SQLite's form, which nothing here reads, and says how to convert them.
void expect_no_sqlite_bag(const std::filesystem::path& file);

/// Throws IoError unless there is such a folder, which can be read, and something in it.
void expect_folder(const std::filesystem::path& folder);

}  // namespace twofold
