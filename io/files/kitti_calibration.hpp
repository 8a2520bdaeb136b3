#pragma once

#include <cstdint>
#include <filesystem>

#include "camera/calibration.hpp"

namespace twofold {

/// Does the file begin like KITTI's calib.txt, "P0: ..."?
[[nodiscard]] bool looks_like_kitti_calibration(const std::filesystem::path& file);

/// The four cameras of KITTI's car look the same way: P0 and P1 are grey, P2 and P3 beside them in colour.
enum class KittiPair : std::uint8_t { kGrey, kColour };

/// One camera (P0 or P2) or a pair (P0, P1 or P2, P3); the image size stays 0. The colour cameras are some
/// millimetres off a row: a pair whose right camera is not purely beside the left one is left to be
/// rectified. Throws IoError.
[[nodiscard]] Calibration read_kitti_calibration(const std::filesystem::path& file,
                                                 KittiPair pair = KittiPair::kGrey);

/// Pose of the left colour camera (P2) in the left grey one (P0), of which the benchmark's poses are. Throws
/// IoError.
[[nodiscard]] SE3 read_kitti_colour_in_grey(const std::filesystem::path& file);

}  // namespace twofold
