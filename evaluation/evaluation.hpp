#pragma once

#include <array>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "evaluation/trajectory.hpp"
#include "geometry/sim3.hpp"

namespace twofold {

/// Estimated and true pose of the camera at one time; `t_ns` is the estimate's.
struct PosePair {
  std::int64_t t_ns = 0;
  SE3 T_e_c;  ///< estimate, in its own world e
  SE3 T_w_c;  ///< truth
};

/// For every estimated pose the true one nearest in time, unless farther than max_difference_ns; no
/// interpolation, and one true pose may be the nearest to several: as evo, so that figures compare with
/// published ones. Both in the order of time. O(n + m).
[[nodiscard]] std::vector<PosePair> associate(const Trajectory& estimate, const Trajectory& truth,
                                              std::int64_t max_difference_ns);

enum class Alignment : std::uint8_t { kNone, kSe3, kSim3 };

/// S_w_e that brings the estimate onto the truth: least squares over positions, Umeyama, PAMI 1991.
/// The scale is the least-squares one of that paper, as evaluation tools use it.
/// @return  nullopt when there are fewer than three poses or all lie on one line (the turn around it is
/// undetermined)
[[nodiscard]] std::optional<Sim3> align(const std::vector<PosePair>& pairs, Alignment alignment);

/// Scale of each half of a run, aligned by itself (kSim3): a camera that does not know the unit of length may
/// change its own on the way.
/// @return  nullopt when one of them cannot be aligned
[[nodiscard]] std::optional<std::array<double, 2>> scales_of_halves(const std::vector<PosePair>& pairs);

/// Pose of the camera in the truth's world; the scale acts on the position only.
[[nodiscard]] SE3 aligned_pose(const Sim3& S_w_e, const SE3& T_e_c);

/// The turn that aligned and true orientations differ by at all poses, seen from the camera: R_w_c^-1 R_w_e_c
/// is then the same throughout. As between a camera and the body that carries it.
/// @return  its angle [deg]; nothing when it is less than 15 degrees, or the errors spread about it by more
/// than a tenth of that (root mean square)
[[nodiscard]] std::optional<double> constant_turn_deg(const std::vector<PosePair>& aligned);

/// Variances of the true positions along the principal axes of their spread, ascending [m^2]; all zero for no
/// poses.
[[nodiscard]] Vector3 spread_of_positions(const std::vector<PosePair>& pairs);

/// Whether the true path is so straight that positions leave the turn about it open: across it, it spreads by
/// less than three times `error` (root mean square) [m].
[[nodiscard]] bool is_straight(const std::vector<PosePair>& pairs, double error);

struct ErrorStatistics {
  std::size_t count = 0;
  double rmse = 0, mean = 0, median = 0, stddev = 0, min = 0, max = 0;  ///< stddev of the population
};
/// All zero for no errors.
[[nodiscard]] ErrorStatistics error_statistics(std::vector<double> errors);

/// Relative pose error over pairs of poses (i, j): E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j), Q truth, P estimate
/// (Sturm et al., IROS 2012, eq. 1).
struct RelativeError {
  ErrorStatistics translation;   ///< |trans(E)|  [m]
  ErrorStatistics rotation_deg;  ///< angle of rot(E)
  ErrorStatistics
      translation_percent;  ///< |trans(E)| over the true path between i and j, where that is not zero
};

/// As the KITTI odometry benchmark states them: means over segments of the true path, each error over the
/// segment's nominal length.
struct SegmentErrors {
  double length = 0;  ///< of each segment [m]; 0: of several lengths
  std::size_t count = 0;
  double translation_percent = 0;     ///< t_rel: |trans(E)|, E as in RelativeError
  double rotation_deg_per_100_m = 0;  ///< r_rel: angle of rot(E)
};

struct KittiErrors {
  SegmentErrors mean;                    ///< over the segments of all lengths
  std::vector<SegmentErrors> by_length;  ///< of 100, 200, .. 800 m those that the path is long enough for
};

/// A segment of each length begins at every tenth pose and ends at the first one farther along than that, if
/// there is one (Geiger, Lenz, Urtasun, CVPR 2012, and the benchmark's development kit).
[[nodiscard]] KittiErrors kitti_errors(const std::vector<PosePair>& pairs);

struct EvaluationOptions {
  Alignment alignment = Alignment::kSe3;
  double delta_s = 1.0;            ///< step of the error per time [s] > 0
  double delta_m = 1.0;            ///< step of the error per distance [m] > 0
  double time_tolerance_s = 0.05;  ///< pairs whose times differ from delta_s by more are left out [s] >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct Evaluation {
  Sim3 S_w_e;
  std::optional<std::array<double, 2>> half_scales;  ///< of the estimate as it was; kSim3 only
  std::vector<PosePair> pairs;                       ///< T_e_c already aligned: in the truth's world
  std::vector<double> position_errors;               ///< [m] one a pair
  ErrorStatistics absolute;                          ///< ATE: |t_truth - t_aligned|  [m]
  ErrorStatistics absolute_rotation_deg;             ///< angle between true and aligned orientation
  RelativeError per_second;                          ///< every i with the j nearest to delta_s later
  RelativeError per_metre;  ///< consecutive pieces of the true path of at least delta_m, from its beginning;
                            ///< evo's default ("-d 1 -u m --pairs_from_reference") leaves out the first
  KittiErrors kitti;
  double path_length = 0;  ///< of the truth over the pairs  [m]
};

/// @return  why there is nothing to evaluate, when the alignment is undetermined or there are no pairs
[[nodiscard]] tl::expected<Evaluation, std::string> evaluate(std::vector<PosePair> pairs,
                                                             const EvaluationOptions& options = {});

}  // namespace twofold
