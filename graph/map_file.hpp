#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <stdexcept>
#include <string>

#include "camera/rig.hpp"
#include "graph/keyframe_database.hpp"
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
  KeyframeDatabase
      places;  ///< of keyframes that are in the graph and were not culled; empty: none were described
};

/// Format, little-endian throughout (docs/places.md):
///   "TFMAP", format version (2 bytes), 0; then sections: id (4 bytes), length (8), the bytes, CRC-32 of all
///   of the section before it (4). First `head`, then `keyframes`, `points` and `places` in slices, and
///   `end`, after which nothing follows.
/// A section with an unknown id is skipped if its id's highest bit is set, and refused otherwise: that is how
/// a newer program says whether an older one may read on.
///
/// Version 2 had an entry each for forgotten keyframes and culled points that follow each other, version 1
/// a keyframe's whole entry for culled ones too; both are still read.
inline constexpr std::uint16_t kMapFormatVersion = 3;

/// Writes to FILE.tmp (FILE.tmp1 while another program writes that one) in the same folder, syncs it, renames
/// it over `file`, syncs the folder: whenever the program is killed or the disk is full, `file` is the old
/// map or the new one. Memory: one slice. Throws MapFileError; the temporary file is then removed. Threads
/// that save maps take turns. A graph with more keyframes or points, culled ones included, than load_map
/// takes is refused before anything is written.
///
/// Only a map is replaced, or an empty file: links are followed and stay, modes are kept, and what else has
/// the name, or is no regular file, is refused (graph/map_place.hpp).
///
/// Looks at graph and places through these references only and copies neither, so that any reader they were
/// published to may save them, while their writers go on. Places of keyframes that `graph` does not have, or
/// has culled, are left out.
void save_map(const std::filesystem::path& file, const Rig& rig, const GraphSnapshot& graph,
              const KeyframeDatabase& places);
inline void save_map(const std::filesystem::path& file, const SavedMap& map) {
  save_map(file, map.rig, map.graph, map.places);
}

/// Reads a map; trusts nothing in it: sizes are checked against the file's before anything is allocated,
/// numbers against each other, and the graph's invariants hold afterwards. What is culled and forgotten takes
/// no memory, so that no file takes more than a few times its size. Throws MapFileError.
[[nodiscard]] SavedMap load_map(const std::filesystem::path& file);
/// The same from a stream of `size` bytes; `name` stands in messages.
[[nodiscard]] SavedMap read_map(std::istream& in, std::uint64_t size, const std::string& name);

/// A rig that was calibrated again may go on with a map if nothing is seen farther from where it was [px]:
/// two standard deviations of a match, and what `twofold calibrate` leaves uncertain at an image's edge.
inline constexpr double kAcceptedShift = 1;

/// Empty when measurements of one rig can be used in a map of the other: same sensor, same size, and nowhere
/// in the images, up to disparities of a quarter of their width, is anything seen elsewhere by more than
/// kAcceptedShift. Else what differs, as "baseline is 0.12, the map's is 0.11: ...". Depth unit and range are
/// the source's own affair: the map is in metres.
[[nodiscard]] std::string rig_difference(const Rig& rig, const Rig& map_rig);
/// What differs where that is accepted, and by how much things are seen elsewhere; empty: nothing does.
[[nodiscard]] std::string rig_note(const Rig& rig, const Rig& map_rig);

/// The same for a camera that is only localised in the map. One camera may have another centre and another
/// field of view then: what it takes is that a pixel covers the same angle, to a few per cent, because points
/// are found by how they looked. (ResampledSource makes it so.)
[[nodiscard]] std::string localisation_difference(const Rig& rig, const Rig& map_rig);

/// The places of a map as another rig would have seen them: the same corners at its pixels, and of rigs of
/// the map's own kind their depths.
[[nodiscard]] KeyframeDatabase places_seen_by(const Rig& rig, const SavedMap& map);

}  // namespace twofold
