#pragma once

#include <atomic>
#include <filesystem>
#include <string>

#include "io/sources/frame_source.hpp"

namespace twofold {

/// Throws IoError naming the source when it has no two cameras.
void expect_stereo(const Rig& rig, const std::string& source_text);

/// `twofold run --estimator swf`: the sliding window filter instead of the engine, one thread, frame by
/// frame.
///
/// Writes trajectory.txt (each frame as it left the window), trajectory_causal.txt (both TUM form),
/// groundtruth.txt if known, structure.ply (points with their standard deviations) and summary.json into
/// `folder`. `source`: stereo. Throws IoError for input that cannot be used, std::runtime_error when no frame
/// but the first could be tracked.
void run_filter(FrameSource& source, const std::string& source_text, int window,
                const std::filesystem::path& folder, const std::atomic<bool>& stop);

}  // namespace twofold
