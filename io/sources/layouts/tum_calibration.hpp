#pragma once

#include <filesystem>
#include <optional>

#include "io/sources/recording.hpp"

namespace twofold {

/// The calibration of a folder that lists its images as TUM's RGB-D benchmark does. The first of these that
/// is there: `given` (--calib); calibration.yaml; camera.txt; fx, fy, cx, cy of the source; ETH3D's
/// calibration.txt or OpenLORIS' sensors.yaml; what the dataset's authors published, by the folder's name,
/// which a note says.
///
/// @param usual_depth_unit  of the layout [m], where neither the calibration, calibration.yaml nor camera.txt
///                          says it
/// @param recording  its folder; takes calibration, calibration_file and notes
/// Throws IoError.
void take_tum_calibration(const std::optional<std::filesystem::path>& given, double usual_depth_unit,
                          SourceParameters& parameters, Recording* recording);

}  // namespace twofold
