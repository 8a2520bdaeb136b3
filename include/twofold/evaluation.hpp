#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "twofold/source.hpp"

namespace twofold {

/// TUM, KITTI or EuRoC form, told by the first line; a KITTI file has no times, t_ns is then the line's
/// number; an EuRoC file has poses of the body, not of the camera. Throws std::runtime_error naming the file
/// and line.
[[nodiscard]] TWOFOLD_API std::vector<StampedPose> load_trajectory(const std::filesystem::path& file);
/// TUM form: lines "time[s] tx ty tz qx qy qz qw". Throws std::runtime_error when it cannot be written, and
/// std::invalid_argument as compare does for poses.
TWOFOLD_API void save_trajectory(const std::filesystem::path& file,
                                 const std::vector<StampedPose>& trajectory);

enum class AlignBy : std::uint8_t { kNothing, kRigidMotion, kSimilarity };

struct ComparisonOptions {
  AlignBy align = AlignBy::kRigidMotion;  ///< how the estimate is brought onto the truth first
  double max_time_difference_s = 0.01;    ///< between a pose and the true one nearest in time, in (0, 9e9]

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] TWOFOLD_API std::string invalid_reason() const;
};

/// How far an estimate is from the truth.
struct TrajectoryError {
  std::size_t pairs = 0;     ///< poses that have a true one
  double path_length = 0;    ///< of the truth over the pairs [m]
  double ate_rmse = 0;       ///< absolute trajectory error: root mean square of the distances [m]
  double ate_mean = 0;       ///< [m]
  double ate_median = 0;     ///< [m]
  double ate_max = 0;        ///< [m]
  double rotation_rmse = 0;  ///< angle between true and aligned orientation [rad]
  double rpe_rmse =
      0;  ///< relative error over one second: translation [m]; NaN: no two poses are one second apart
  double scale = 1;  ///< the estimate's lengths times this are the truth's; 1 unless kSimilarity
};

/// Throws std::invalid_argument when there is nothing to compare or the alignment is undetermined, and for
/// poses whose times do not grow, numbers that are not finite, and quaternions that are not within 0.01 of
/// length 1.
[[nodiscard]] TWOFOLD_API TrajectoryError compare(const std::vector<StampedPose>& estimate,
                                                  const std::vector<StampedPose>& truth,
                                                  const ComparisonOptions& options = {});

}  // namespace twofold
