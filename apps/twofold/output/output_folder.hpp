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

/// Of an earlier run into the folder, what is written at the end only: should this run be killed, its folder
/// holds nothing of another one's. For folders that expect_output_folder has let through.
/// @param calibration  the file that this run was given, or has written: it stays
void remove_results(const std::filesystem::path& folder, const std::filesystem::path& calibration);

/// The files of further map parts, from that of index `parts` on: an earlier run had more.
void remove_part_files(const std::filesystem::path& folder, std::size_t parts);

/// What an earlier run wrote as it went, for a run that writes no such files.
void remove_logs(const std::filesystem::path& folder);

}  // namespace twofold
