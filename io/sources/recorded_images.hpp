#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

namespace twofold {

/// The left image of the frame with that time stamp, rectified, in colour (CV_8UC3: blue, green, red) if it
/// has any, else CV_8UC1; empty when there is none. Any thread, while other threads play the recording.
/// Throws IoError.
using RecordedImages = std::function<cv::Mat(std::int64_t t_ns)>;

/// Of a source of frames that is a folder of image files (kitti, euroc, tum, images); an empty function for
/// all others, which cannot be asked for a frame without playing those before it. No camera is opened. Throws
/// IoError as open_source does.
/// @param calibration  as SourceOptions::calibration
[[nodiscard]] RecordedImages images_of_recording(const std::string& source,
                                                 const std::optional<std::filesystem::path>& calibration);

/// Of a folder that a Recorder writes into; frames that are not written yet have none.
[[nodiscard]] RecordedImages images_being_recorded(const std::filesystem::path& folder);

}  // namespace twofold
