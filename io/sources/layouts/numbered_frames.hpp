#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string_view>
#include <vector>

#include "io/sources/layouts/published_cameras.hpp"
#include "io/sources/recording.hpp"

namespace twofold {

/// A file with a frame's number in its name, as frame-000042.color.png or 42.jpg.
struct NumberedFile {
  std::int64_t number = 0;
  std::filesystem::path file;
};

/// Files in a folder whose names are `before`, a number, and one of `after`, by number; empty if there are
/// none. Throws IoError when the folder cannot be read, and for a number
/// that two of them have.
[[nodiscard]] std::vector<NumberedFile> list_numbered(const std::filesystem::path& folder,
                                                      std::string_view before,
                                                      std::initializer_list<std::string_view> after);

/// Whether list_numbered would find any.
[[nodiscard]] bool has_numbered(const std::filesystem::path& folder, std::string_view before,
                                std::initializer_list<std::string_view> after);

/// The frame rate that the numbers count: parameter fps, or the usual one.
[[nodiscard]] double take_numbered_fps(double usual, SourceParameters& parameters);

/// When the frame of that number was taken [ns]. Throws IoError where that is beyond all times.
[[nodiscard]] std::int64_t time_of_number(const NumberedFile& file, double fps);

/// RGB-D frames of images that have the same number; numbers that are missing are gaps in time. An image
/// without partner is refused, unless unpaired=drop is given.
///
/// @param depth  not looked at where only the left camera is wanted
void take_numbered_frames(const std::vector<NumberedFile>& colour, const std::vector<NumberedFile>& depth,
                          double fps, SourceParameters& parameters, Recording* recording);

/// The calibration: `given`, calibration.yaml in the folder, the source's fx, fy, cx, cy, or else what
/// `otherwise` returns, nothing of it where `otherwise` has none. `usual_depth_unit` [m] holds where none of
/// them says it.
void take_numbered_calibration(const std::optional<std::filesystem::path>& given,
                               const std::function<std::optional<Calibration>()>& otherwise,
                               double usual_depth_unit, SourceParameters& parameters, Recording* recording);

/// Whether a folder has the images of such a recording, where they lie in it.
[[nodiscard]] bool is_seven_scenes(const std::filesystem::path& folder);
[[nodiscard]] bool is_replica(const std::filesystem::path& folder);
[[nodiscard]] bool is_scannet(const std::filesystem::path& folder);

}  // namespace twofold
