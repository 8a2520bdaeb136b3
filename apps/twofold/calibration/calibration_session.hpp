#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

#include "io/sources/frame_source.hpp"
#include "twofold/calibration.hpp"

namespace twofold {

struct CalibrationRequest {
  std::string board;           ///< as BoardCalibrator takes it
  int views = 20;              ///< wanted from a camera, 10 to 200
  std::filesystem::path out;   ///< calibration file to write
  std::filesystem::path plot;  ///< picture of the residuals to write
  bool video = false;          ///< the frames follow each other as a camera's do
};

/// Shows a source's frames to a BoardCalibrator until nothing is missing (a camera or a video), the source
/// ends or `stop` is set; calibrates; writes the calibration file and the picture of its residuals.
///
/// @param source  of raw images
/// @param say  hears a line for the person with the board whenever it changes
/// @return  the result, some lines for people
///
/// Throws IoError for a source that breaks, std::runtime_error with the reason when the calibration is
/// refused; nothing is written then.
[[nodiscard]] std::string calibrate_from(FrameSource& source, const CalibrationRequest& request,
                                         const std::atomic<bool>& stop,
                                         const std::function<void(const std::string&)>& say);

}  // namespace twofold
