#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace twofold {

/// Refuses (IoError) a run's output folder in which the run would destroy what is not Twofold's: that of the
/// source itself, links followed; and one that has files of the names that a run writes, unless an earlier
/// run has left its mark there: its summary.json, or its schedule.log, which a killed run leaves, too.
/// Nothing is changed.
void expect_output_folder(const std::filesystem::path& folder, const std::string& source);

/// Refuses (IoError) the folder of the source itself, links followed, for what `option` names.
void expect_not_of_source(const std::filesystem::path& folder, const std::string& source,
                          const std::string& option);

/// Refuses (IoError) a file that `option` names where none can be written: known now, not after an hour of
/// work. Nothing is changed; empty: there is nothing to write.
void expect_place_for_file(const std::filesystem::path& file, const std::string& option);

/// Refuses (IoError) a folder whose calibration.yaml is not what an earlier run into it found by itself: one
/// that calibrates itself writes another there.
void expect_place_for_calibration(const std::filesystem::path& folder);

/// What an earlier run into the folder wrote there by itself: should this one be killed, or end before it has
/// anything to write, its folder holds nothing of another one's. Files that the user named, as maps, stay.
/// For folders that expect_output_folder has let through.
/// @param calibration  the file that this run was given, or has written: it stays
void remove_earlier_run(const std::filesystem::path& folder, const std::filesystem::path& calibration);

/// The files of further map parts, from that of index `parts` on: an earlier run had more.
void remove_part_files(const std::filesystem::path& folder, std::size_t parts);

}  // namespace twofold
