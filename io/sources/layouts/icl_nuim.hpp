#pragma once

#include <filesystem>

#include "evaluation/trajectory.hpp"

namespace twofold {

/// ICL-NUIM's recordings have numbers of frames for times; its authors rendered 30 a second.
inline constexpr int kIclNuimFps = 30;

/// The truth beside the images of an ICL-NUIM recording, livingRoom2.gt.freiburg or traj2.gt.freiburg. Empty:
/// there is none, or more than one.
[[nodiscard]] std::filesystem::path icl_nuim_truth_file(const std::filesystem::path& folder);

/// Poses of the camera whose images are played. The file has them in TUM's form, numbers of frames for times,
/// and in the renderer's axes, camera's and world's, whose y points up: left-handed, so that its path is the
/// mirror image of what any camera can find. Here both are mirrored in y, and times are seconds. Throws
/// IoError.
[[nodiscard]] Trajectory read_icl_nuim_trajectory(const std::filesystem::path& file);

}  // namespace twofold
