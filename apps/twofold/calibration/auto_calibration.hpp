#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "camera/calibration.hpp"
#include "io/sources/open_source.hpp"
#include "selfcalibration/self_calibration.hpp"

namespace twofold {

/// The file in the output folder, and what its `quality: board:` is.
constexpr const char* kCalibrationName = "calibration.yaml";
constexpr const char* kCalibratedByVideo = "none, the video itself";

/// What `--calib auto` found.
struct AutoCalibration {
  SelfCalibration found;
  Calibration calibration;
  double seconds = 0;          ///< of the video that it took
  std::filesystem::path file;  ///< where it was written to
};

/// A source of one camera whose calibration is found from its own first frames, at most half a minute of
/// them. A recording is then read from its beginning again; a camera's frames until then are gone. Writes
/// FOLDER/calibration.yaml, which `--calib` takes.
///
/// Throws IoError when the source has more than one camera, or does not show the calibration.
[[nodiscard]] std::unique_ptr<FrameSource> open_with_auto_calibration(const std::string& text,
                                                                      SourceOptions options,
                                                                      const std::filesystem::path& folder,
                                                                      AutoCalibration& result);

/// What summary.json says of it.
[[nodiscard]] nlohmann::ordered_json auto_calibration_json(const AutoCalibration& result);
/// A line for people.
void print_auto_calibration(const AutoCalibration& result);

}  // namespace twofold
