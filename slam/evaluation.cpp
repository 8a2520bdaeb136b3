#include "twofold/evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "base/angles.hpp"
#include "base/option_check.hpp"
#include "evaluation/evaluation.hpp"
#include "io/files/trajectory_file.hpp"
#include "slam/conversions.hpp"

namespace twofold {
namespace {

Trajectory to_trajectory(const std::vector<StampedPose>& poses) {
  Trajectory trajectory;
  for (const StampedPose& pose : poses) {
    const auto expect = [&](bool condition, const char* what) {
      if (!condition) throw std::invalid_argument(fmt::format("pose {} {}", trajectory.size(), what));
    };
    expect(trajectory.empty() || pose.t_ns > trajectory.back().t_ns, "is not after the one before it");
    expect(is_rigid_motion(pose.T_world_camera), "is not of finite numbers and a unit quaternion");
    trajectory.push_back({pose.t_ns, to_se3(pose.T_world_camera)});
  }
  return trajectory;
}

Alignment alignment_of(AlignBy align) {
  switch (align) {
    case AlignBy::kNothing:
      return Alignment::kNone;
    case AlignBy::kRigidMotion:
      return Alignment::kSe3;
    case AlignBy::kSimilarity:
      break;
  }
  return Alignment::kSim3;
}

}  // namespace

std::vector<StampedPose> load_trajectory(const std::filesystem::path& file) {
  std::vector<StampedPose> poses;
  for (const TimedPose& pose : read_trajectory(file)) poses.push_back({pose.t_ns, to_pose(pose.T_w_c)});
  return poses;
}

void save_trajectory(const std::filesystem::path& file, const std::vector<StampedPose>& trajectory) {
  write_tum_trajectory(file, to_trajectory(trajectory));
}

std::string ComparisonOptions::invalid_reason() const {
  constexpr double kLongest = 9e9;  // [s] that fit into nanoseconds of 64 bit
  return OptionCheck()
      .that(max_time_difference_s > 0 && max_time_difference_s <= kLongest, "max_time_difference_s",
            "in (0, 9e9]", max_time_difference_s)
      .reason();
}

TrajectoryError compare(const std::vector<StampedPose>& estimate, const std::vector<StampedPose>& truth,
                        const ComparisonOptions& options) {
  if (const std::string why = options.invalid_reason(); !why.empty())
    throw std::invalid_argument("options." + why);
  const auto farthest = static_cast<std::int64_t>(options.max_time_difference_s * 1e9);
  EvaluationOptions inside;
  inside.alignment = alignment_of(options.align);
  const auto result = evaluate(associate(to_trajectory(estimate), to_trajectory(truth), farthest), inside);
  if (!result) throw std::invalid_argument(result.error());
  TrajectoryError error;
  error.pairs = result->pairs.size();
  error.path_length = result->path_length;
  error.ate_rmse = result->absolute.rmse;
  error.ate_mean = result->absolute.mean;
  error.ate_median = result->absolute.median;
  error.ate_max = result->absolute.max;
  error.rotation_rmse = result->absolute_rotation_deg.rmse * kDegree;
  const ErrorStatistics& per_second = result->per_second.translation;
  error.rpe_rmse = per_second.count > 0 ? per_second.rmse : std::numeric_limits<double>::quiet_NaN();
  error.scale = result->S_w_e.scale();
  return error;
}

}  // namespace twofold
