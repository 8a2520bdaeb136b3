#include "apps/twofold/output/output_folder.hpp"

#include <array>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "apps/twofold/calibration/auto_calibration.hpp"
#include "apps/twofold/map_parts.hpp"
#include "engine/logs/schedule_log.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/source_path.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr std::array kLogs{"trajectory_causal.txt", "schedule.log"};
constexpr std::array kResults{"trajectory.txt",   "keyframes.txt",  "keyframes_loaded.txt", "frames.txt",
                              "edges.txt",        "map.ply",        "groundtruth.txt",      "timing.json",
                              "summary.json",     "trajectory.png", "surface.ply",          "surface.glb",
                              "loop_latency.txt", "cloud.ply",      "object.json",          "structure.ply"};

/// summary.json of a run of whatever estimator; null: there is none.
nlohmann::json earlier_summary(const fs::path& folder) {
  std::ifstream file(folder / "summary.json");
  nlohmann::json summary = nlohmann::json::parse(file, nullptr, false);
  if (!summary.is_object()) return nullptr;
  for (const char* key : {"source", "frames", "tracked", "wall_seconds"})
    if (!summary.contains(key)) return nullptr;
  return summary;
}

bool is_of_a_run(const fs::path& folder) {
  return !earlier_summary(folder).is_null() || load_schedule(folder / "schedule.log").has_value();
}

/// That a run found by itself, and nobody has replaced since. It may be all that is left of a run that was
/// refused afterwards.
bool is_found_calibration(const fs::path& folder) {
  std::ifstream file(folder / kCalibrationName);
  const std::string text(std::istreambuf_iterator<char>(file), {});
  return text.find(kCalibratedByVideo) != std::string::npos;
}

}  // namespace

void expect_not_of_source(const fs::path& folder, const std::string& source, const std::string& option) {
  const auto path = path_of_source(source);
  std::error_code error;
  if (!path || !fs::equivalent(folder, *path, error)) return;
  throw IoError(folder, "is the folder of the source: " + option + " must name another one");
}

void expect_output_folder(const fs::path& folder, const std::string& source) {
  expect_not_of_source(folder, source, "--out");
  if (is_of_a_run(folder)) return;
  const auto expect_free = [&](const char* name) {
    std::error_code error;
    if (!fs::exists(fs::symlink_status(folder / name, error))) return;
    throw IoError(folder / name,
                  "would be overwritten, and no run of Twofold has left its mark beside it (summary.json, "
                  "schedule.log): name another folder for --out, or move the file");
  };
  for (const char* name : kLogs) expect_free(name);
  for (const char* name : kResults) expect_free(name);
}

void expect_place_for_file(const fs::path& file, const std::string& option) {
  if (fs::is_directory(file)) throw IoError(file, "is a folder, no file for " + option);
  if (file.has_parent_path() && !fs::is_directory(file.parent_path()))
    throw IoError(file, "the folder is not there");
}

void expect_place_for_calibration(const fs::path& folder) {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(folder / kCalibrationName, error)) || is_found_calibration(folder))
    return;
  throw IoError(
      folder / kCalibrationName,
      "would be overwritten by what --calib auto finds, and is not what a run has found: name another folder "
      "for --out, or move the file");
}

void remove_earlier_run(const fs::path& folder, const fs::path& calibration) {
  std::error_code error;
  const fs::path own = folder / kCalibrationName;
  if (is_of_a_run(folder) && is_found_calibration(folder) && !fs::equivalent(own, calibration, error))
    fs::remove(own, error);
  for (const char* name : kResults) fs::remove(folder / name, error);
  for (const std::string name : kLogs) {
    fs::remove(folder / name, error);
    fs::remove(folder / (name + ".new"), error);  // of a run that was killed while it replaced it
  }
  remove_part_files(folder, 1);
}

void remove_part_files(const fs::path& folder, std::size_t parts) {
  const auto remove = [&](const char* stem, std::size_t n, const char* extension) {
    std::error_code error;
    return fs::remove(folder / part_file(stem, n, extension), error);
  };
  for (std::size_t n = parts; remove("trajectory", n, ".txt"); ++n) {
    remove("keyframes", n, ".txt");
    remove("keyframes_loaded", n, ".txt");
    remove("map", n, ".ply");
    remove("edges", n, ".txt");
  }
}

}  // namespace twofold
