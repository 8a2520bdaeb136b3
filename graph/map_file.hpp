#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <stdexcept>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "graph/snapshot.hpp"

namespace twofold {

/// A file that is no map, or not an intact one; the message names the file, the section and what is wrong.
class MapFileError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What a map file (.tfm) holds.
struct SavedMap {
  Rig rig;
  GraphSnapshot graph;
  /// How places look, as LoopCloser::save_places made it; empty when places were not described.
  std::vector<std::uint8_t> places;
};

/// Format, little-endian throughout (docs/formats.md):
///   "TFMAP", format version (2 bytes), 0; then sections: id (4 bytes), length (8), the bytes, CRC-32 of all
///   of the section before it (4). First `head`, then `keyframes` and `points` in slices, `places` if there
///   are any, and `end`, after which nothing follows.
/// A section with an unknown id is skipped if its id's highest bit is set, and refused otherwise: that is how
/// a newer program says whether an older one may read on.
inline constexpr std::uint16_t kMapFormatVersion = 1;

/// Writes to FILE.tmp in the same folder, syncs it, renames it over `file`, syncs the folder: whenever the
/// program is killed or the disk is full, `file` is the old map or the new one. Memory: one slice. Throws
/// MapFileError; the temporary file is then removed.
void save_map(const std::filesystem::path& file, const SavedMap& map);

/// Reads a map; trusts nothing in it: sizes are checked against the file's before anything is allocated,
/// numbers against each other, and the graph's invariants hold afterwards. Throws MapFileError.
[[nodiscard]] SavedMap load_map(const std::filesystem::path& file);
/// The same from a stream of `size` bytes; `name` stands in messages.
[[nodiscard]] SavedMap read_map(std::istream& in, std::uint64_t size, const std::string& name);

}  // namespace twofold
