#pragma once

#include <filesystem>

#include "camera/calibration.hpp"
#include "io/files/yaml_node.hpp"

namespace twofold {

/// The sensor of OpenLORIS whose images are played, a RealSense D435i's colour camera, by its name in the
/// dataset's own sensors.yaml and trans_matrix.yaml.
inline constexpr const char* kOpenLorisColour = "d400_color_optical_frame";

/// From sensors.yaml, whose intrinsics are fx cx fy cy, in this order. Throws IoError.
[[nodiscard]] Calibration read_openloris_sensors(const YamlNode& root);

/// Pose of the colour camera in base_link, whose poses the dataset's truth has, from trans_matrix.yaml: a
/// list of parent_frame, child_frame and matrix, over the laser in some recordings. Throws IoError where no
/// chain of them leads there.
[[nodiscard]] SE3 read_openloris_camera_in_base(const std::filesystem::path& file);

}  // namespace twofold
