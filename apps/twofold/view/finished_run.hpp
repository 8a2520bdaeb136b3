#pragma once

#include <filesystem>

#include "viewer/texts.hpp"

namespace twofold {

/// What `twofold run` left in a folder, as a scene: final and causal path, keyframes, points, events
/// (corrections, relocalisations, new parts, loops), what was lost and why, of all parts of the map.
/// Keyframes are numbered in the order of time. Throws IoError naming the file that is missing or wrong.
void show_finished_run(const std::filesystem::path& folder, ViewScene& scene, ViewTitle& title);

}  // namespace twofold
