#pragma once

#include <filesystem>

namespace twofold {

/// Refuses (MapFileError) what save_map would refuse to write to, before there is a map: a folder, a device
/// or a pipe; a file that is there, not empty, and no map; a folder that cannot be written in. Links are
/// followed.
void expect_place_for_map(const std::filesystem::path& file);

}  // namespace twofold
