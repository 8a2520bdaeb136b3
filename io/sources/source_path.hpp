#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace twofold {

/// Where the frames of a source, as the user writes it, are: a file or a folder. None: they are rendered, or
/// a camera's. Throws as parse_source_spec.
[[nodiscard]] std::optional<std::filesystem::path> path_of_source(const std::string& text);

/// The same source for a reader in whatever folder: its path is absolute, the rest of the text as it was.
[[nodiscard]] std::string absolute_source(const std::string& text);

}  // namespace twofold
