#pragma once

#include <filesystem>

#include "viewer/keyframe_images.hpp"
#include "viewer/texts.hpp"

namespace twofold {

/// What `twofold run` left in a folder, as a scene: final and causal path, keyframes, points, events, what
/// was lost and why. Throws IoError naming the file that is missing or wrong.
void show_finished_run(const std::filesystem::path& folder, ViewScene& scene, ViewTitle& title);

/// Images of its keyframes, from what it recorded or else from the recording it was made of; empty when that
/// is not to be had any more, or is no folder of images.
[[nodiscard]] KeyframeImages::Find images_of_run(const std::filesystem::path& folder);

/// A map file likewise; its path is that of its keyframes.
void show_map_file(const std::filesystem::path& file, ViewScene& scene, ViewTitle& title);

}  // namespace twofold
