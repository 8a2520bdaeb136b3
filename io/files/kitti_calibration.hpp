#pragma once

#include <filesystem>

#include "camera/calibration.hpp"

namespace twofold {

/// Does the file begin like KITTI's calib.txt, "P0: ..."?
[[nodiscard]] bool looks_like_kitti_calibration(const std::filesystem::path& file);

/// One camera (P0) or a rectified pair (P0, P1); the image size stays 0. Throws IoError.
[[nodiscard]] Calibration read_kitti_calibration(const std::filesystem::path& file);

}  // namespace twofold
