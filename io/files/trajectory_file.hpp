#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "evaluation/trajectory.hpp"
#include "io/files/text_file.hpp"

namespace twofold {

/// How a cut last line is dealt with, as a run leaves one that was killed.
enum class CutLine : std::uint8_t { kRefused, kLeftOut };

/// kAny: of poses from several recordings.
enum class TimeOrder : std::uint8_t { kIncreasing, kAny };

struct TumReading {
  CutLine cut =
      CutLine::kRefused;  ///< kLeftOut: a last line without a line end that is not whole is no error
  TimeOrder order = TimeOrder::kIncreasing;
  std::optional<TimeUnit> unit =
      std::nullopt;  ///< nothing: seconds, or nanoseconds where numbers are too large for others
};

/// TUM form: lines "time[s] tx ty tz qx qy qz qw" of T_w_c  [m].
/// Throws IoError for anything that is not a finite number, a quaternion that is far from unit length, and
/// time stamps out of order or repeated, unless any order will do.
/// @param note   what was left out, if anything was
[[nodiscard]] Trajectory read_tum_trajectory(const std::filesystem::path& file, const TumReading& how = {},
                                             std::string* note = nullptr);

/// KITTI form: lines of the 12 numbers of the 3x4 matrix T_w_c, row by row. There are no time stamps: t_ns
/// counts lines.
[[nodiscard]] Trajectory read_kitti_trajectory(const std::filesystem::path& file);

/// The same with 16 numbers a line: the 4x4 matrix T_w_c.
[[nodiscard]] Trajectory read_matrix_trajectory(const std::filesystem::path& file);

/// A file of one 4x4 matrix T_w_c, as 7-Scenes and ScanNet have one an image. Nothing where it has an
/// infinity or no number (nan), as those of images whose pose nobody knows. Throws IoError for all other than
/// 16 numbers, and for what is no rigid motion.
[[nodiscard]] std::optional<SE3> read_pose_matrix(const std::filesystem::path& file);

/// EuRoC state_groundtruth_estimate0/data.csv: "time[ns],px,py,pz,qw,qx,qy,qz,..." of T_w_s.
[[nodiscard]] Trajectory read_euroc_trajectory(const std::filesystem::path& file);

enum class TrajectoryForm : std::uint8_t { kTum, kKitti, kEuroc };

/// Form by the first line: 12 numbers, 8 numbers, or commas. Throws IoError for others and for an empty file.
[[nodiscard]] TrajectoryForm trajectory_form(const std::filesystem::path& file);
[[nodiscard]] Trajectory read_trajectory(const std::filesystem::path& file);

/// The same poses always give the same bytes. Throws IoError when the file cannot be written in full (disk
/// full).
void write_tum_trajectory(const std::filesystem::path& file, const Trajectory& trajectory);

}  // namespace twofold
