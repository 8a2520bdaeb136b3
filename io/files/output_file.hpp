#pragma once

#include <filesystem>
#include <string_view>

namespace twofold {

/// Writes a whole file. Throws IoError when it cannot be opened or not all of it could be written (disk
/// full).
void write_file(const std::filesystem::path& file, std::string_view content);

/// Makes sure the folder exists and files can be written in it; throws IoError. Call it before a long run,
/// not after.
void prepare_output_folder(const std::filesystem::path& folder);

}  // namespace twofold
