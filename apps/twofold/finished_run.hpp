#pragma once

#include <filesystem>

#include "viewer/texts.hpp"

namespace twofold {

/// What `twofold run` left in a folder, as a scene: final and causal path, keyframes, points, events, what
/// was lost and why. Throws IoError naming the file that is missing or wrong.
void show_finished_run(const std::filesystem::path& folder, ViewScene& scene, ViewTitle& title);

/// A map file likewise; its path is that of its keyframes.
void show_map_file(const std::filesystem::path& file, ViewScene& scene, ViewTitle& title);

}  // namespace twofold
