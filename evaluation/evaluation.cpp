#include "evaluation/evaluation.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>

#include "base/check.hpp"
#include "base/option_check.hpp"
#include "geometry/absolute_orientation.hpp"

namespace twofold {
namespace {

constexpr std::size_t kFewestToAlign = 3;

using IndexPair = std::pair<std::size_t, std::size_t>;

double angle_deg(const SO3& R) {
  return R.log().norm() * 180.0 / std::numbers::pi;
}

/// Length of the true path from the first pose to each.
std::vector<double> path_lengths(const std::vector<PosePair>& pairs) {
  std::vector<double> lengths(pairs.size(), 0.0);
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    lengths[i] = lengths[i - 1] + (pairs[i].T_w_c.translation() - pairs[i - 1].T_w_c.translation()).norm();
  }
  return lengths;
}

/// Every pose with the one nearest to delta later; times increase, so j only moves forward.
std::vector<IndexPair> pairs_by_time(const std::vector<PosePair>& pairs, double delta_s, double tolerance_s) {
  std::vector<IndexPair> result;
  const auto off = [&](std::size_t i, std::size_t j) {
    return std::abs(static_cast<double>(pairs[j].t_ns - pairs[i].t_ns) * 1e-9 - delta_s);
  };
  std::size_t j = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    j = std::max(j, i);
    while (j + 1 < pairs.size() && off(i, j + 1) <= off(i, j)) ++j;
    if (j > i && off(i, j) <= tolerance_s) result.emplace_back(i, j);
  }
  return result;
}

/// Consecutive pieces of the path: a piece ends at the first pose at least delta_m from the end of the last
/// one.
std::vector<IndexPair> pairs_by_path(const std::vector<double>& lengths, double delta_m) {
  std::vector<IndexPair> result;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    if (lengths[i] - lengths[begin] < delta_m) continue;
    result.emplace_back(begin, i);
    begin = i;
  }
  return result;
}

SE3 step_error(const PosePair& from, const PosePair& to) {
  const SE3 truth_i_j = from.T_w_c.inverse() * to.T_w_c;
  const SE3 estimate_i_j = from.T_e_c.inverse() * to.T_e_c;
  return truth_i_j.inverse() * estimate_i_j;
}

RelativeError relative_error(const std::vector<PosePair>& pairs, const std::vector<IndexPair>& steps,
                             const std::vector<double>& lengths) {
  std::vector<double> translation, rotation, percent;
  for (const auto& [i, j] : steps) {
    const SE3 E = step_error(pairs[i], pairs[j]);
    translation.push_back(E.translation().norm());
    rotation.push_back(angle_deg(E.so3()));
    if (lengths[j] > lengths[i]) percent.push_back(100.0 * translation.back() / (lengths[j] - lengths[i]));
  }
  return {error_statistics(std::move(translation)), error_statistics(std::move(rotation)),
          error_statistics(std::move(percent))};
}

/// Sums of the errors, each over the length: means once they are divided by the count.
SegmentErrors segment_sums(const std::vector<PosePair>& pairs, const std::vector<double>& lengths,
                           double length) {
  constexpr std::size_t kEvery = 10;  // poses; the benchmark's frames come at 10 Hz
  SegmentErrors sums{.length = length};
  for (std::size_t i = 0; i < pairs.size(); i += kEvery) {
    const auto end = std::upper_bound(lengths.begin(), lengths.end(), lengths[i] + length);
    if (end == lengths.end()) break;
    const SE3 E = step_error(pairs[i], pairs[static_cast<std::size_t>(end - lengths.begin())]);
    ++sums.count;
    sums.translation_percent += 100 * E.translation().norm() / length;
    sums.rotation_deg_per_100_m += 100 * angle_deg(E.so3()) / length;
  }
  return sums;
}

void divide_by_count(SegmentErrors* sums) {
  if (sums->count == 0) return;
  sums->translation_percent /= static_cast<double>(sums->count);
  sums->rotation_deg_per_100_m /= static_cast<double>(sums->count);
}

}  // namespace

KittiErrors kitti_errors(const std::vector<PosePair>& pairs) {
  const std::vector<double> lengths = path_lengths(pairs);
  KittiErrors errors;
  for (const double length : {100, 200, 300, 400, 500, 600, 700, 800}) {
    SegmentErrors sums = segment_sums(pairs, lengths, length);
    if (sums.count == 0) break;
    errors.mean.count += sums.count;
    errors.mean.translation_percent += sums.translation_percent;
    errors.mean.rotation_deg_per_100_m += sums.rotation_deg_per_100_m;
    divide_by_count(&sums);
    errors.by_length.push_back(sums);
  }
  divide_by_count(&errors.mean);
  return errors;
}

std::vector<PosePair> associate(const Trajectory& estimate, const Trajectory& truth,
                                std::int64_t max_difference_ns) {
  std::vector<PosePair> pairs;
  std::size_t j = 0;
  for (const TimedPose& pose : estimate) {
    const auto difference = [&](std::size_t k) { return std::abs(truth[k].t_ns - pose.t_ns); };
    while (j + 1 < truth.size() && difference(j + 1) < difference(j)) ++j;
    if (j < truth.size() && difference(j) <= max_difference_ns) {
      pairs.push_back({pose.t_ns, pose.T_w_c, truth[j].T_w_c});
    }
  }
  return pairs;
}

std::optional<Sim3> align(const std::vector<PosePair>& pairs, Alignment alignment) {
  if (alignment == Alignment::kNone) return Sim3();
  std::vector<Vector3> x_w, x_e;
  for (const PosePair& pair : pairs) {
    x_w.push_back(pair.T_w_c.translation());
    x_e.push_back(pair.T_e_c.translation());
  }
  const auto T_w_e = align_rigid(x_w, x_e);
  if (!T_w_e) return std::nullopt;
  if (alignment == Alignment::kSe3) return Sim3(*T_w_e);

  // The rotation does not depend on the scale; then s = sum y_w . R y_e / sum |y_e|^2  (Umeyama eq. 42).
  const double n = static_cast<double>(pairs.size());
  const Vector3 zero = Vector3::Zero();
  const Vector3 mean_w = std::accumulate(x_w.begin(), x_w.end(), zero) / n;
  const Vector3 mean_e = std::accumulate(x_e.begin(), x_e.end(), zero) / n;
  double along = 0, spread = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    along += (x_w[i] - mean_w).dot(T_w_e->so3() * (x_e[i] - mean_e));
    spread += (x_e[i] - mean_e).squaredNorm();
  }
  const double s = along / spread;
  if (!(s > 0)) return std::nullopt;
  return Sim3(s, T_w_e->so3(), mean_w - s * (T_w_e->so3() * mean_e));
}

std::optional<std::array<double, 2>> scales_of_halves(const std::vector<PosePair>& pairs) {
  const auto middle = pairs.begin() + static_cast<std::ptrdiff_t>(pairs.size() / 2);
  const auto first = align({pairs.begin(), middle}, Alignment::kSim3);
  const auto second = align({middle, pairs.end()}, Alignment::kSim3);
  if (!first || !second) return std::nullopt;
  return std::array{first->scale(), second->scale()};
}

SE3 aligned_pose(const Sim3& S_w_e, const SE3& T_e_c) {
  return {S_w_e.so3() * T_e_c.so3(),
          S_w_e.scale() * (S_w_e.so3() * T_e_c.translation()) + S_w_e.translation()};
}

std::optional<double> constant_turn_deg(const std::vector<PosePair>& aligned) {
  constexpr double kLeastDeg = 15, kMostSpread = 0.1;
  Matrix3 sum = Matrix3::Zero();
  for (const PosePair& pair : aligned) sum += (pair.T_w_c.so3().inverse() * pair.T_e_c.so3()).matrix();
  // The rotation nearest to the sum is the mean in the chordal sense; where two of its singular values vanish
  // the errors have no mean to speak of, and then they spread, too.
  const Eigen::JacobiSVD<Matrix3> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double handed = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const SO3 mean(Matrix3(svd.matrixU() * Vector3(1, 1, handed).asDiagonal() * svd.matrixV().transpose()));
  const double turn = angle_deg(mean);
  if (turn < kLeastDeg) return std::nullopt;
  std::vector<double> spread;
  spread.reserve(aligned.size());
  for (const PosePair& pair : aligned)
    spread.push_back(angle_deg(mean.inverse() * pair.T_w_c.so3().inverse() * pair.T_e_c.so3()));
  if (error_statistics(std::move(spread)).rmse > kMostSpread * turn) return std::nullopt;
  return turn;
}

Vector3 spread_of_positions(const std::vector<PosePair>& pairs) {
  const auto count = static_cast<double>(pairs.size());
  Vector3 mean = Vector3::Zero();
  for (const PosePair& pair : pairs) mean += pair.T_w_c.translation() / count;
  Matrix3 spread = Matrix3::Zero();
  for (const PosePair& pair : pairs) {
    const Vector3 d = pair.T_w_c.translation() - mean;
    spread += d * d.transpose() / count;
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3> solver(spread, Eigen::EigenvaluesOnly);
  return solver.eigenvalues();
}

bool is_straight(const std::vector<PosePair>& pairs, double error) {
  const double across = spread_of_positions(pairs)[1];  // [2] is along the path
  return std::sqrt(std::max(0.0, across)) < 3 * error;
}

ErrorStatistics error_statistics(std::vector<double> errors) {
  ErrorStatistics s;
  s.count = errors.size();
  if (errors.empty()) return s;
  std::sort(errors.begin(), errors.end());
  const double n = static_cast<double>(errors.size());
  s.mean = std::accumulate(errors.begin(), errors.end(), 0.0) / n;
  double squares = 0, deviations = 0;
  for (const double e : errors) {
    squares += e * e;
    deviations += (e - s.mean) * (e - s.mean);
  }
  s.rmse = std::sqrt(squares / n);
  s.stddev = std::sqrt(deviations / n);
  const std::size_t middle = errors.size() / 2;
  s.median = errors.size() % 2 == 1 ? errors[middle] : 0.5 * (errors[middle - 1] + errors[middle]);
  s.min = errors.front();
  s.max = errors.back();
  return s;
}

tl::expected<Evaluation, std::string> evaluate(std::vector<PosePair> pairs,
                                               const EvaluationOptions& options) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "evaluation options");
  if (pairs.empty()) return tl::unexpected<std::string>("no poses of the two trajectories are close in time");
  const auto S_w_e = align(pairs, options.alignment);
  if (!S_w_e) {
    const std::string with_partner = std::to_string(pairs.size()) + " poses have a partner in time";
    return tl::unexpected("cannot be aligned: " + with_partner +
                          (pairs.size() < kFewestToAlign ? ", it takes three" : ", all on one line") +
                          " (align none compares them as they are)");
  }
  Evaluation result;
  result.S_w_e = *S_w_e;
  if (options.alignment == Alignment::kSim3) result.half_scales = scales_of_halves(pairs);
  std::vector<double> rotation_errors;
  for (PosePair& pair : pairs) {
    pair.T_e_c = aligned_pose(*S_w_e, pair.T_e_c);
    result.position_errors.push_back((pair.T_w_c.translation() - pair.T_e_c.translation()).norm());
    rotation_errors.push_back(angle_deg(pair.T_w_c.so3().inverse() * pair.T_e_c.so3()));
  }
  result.absolute = error_statistics(result.position_errors);
  result.absolute_rotation_deg = error_statistics(std::move(rotation_errors));
  const auto lengths = path_lengths(pairs);
  result.path_length = lengths.back();
  result.per_second =
      relative_error(pairs, pairs_by_time(pairs, options.delta_s, options.time_tolerance_s), lengths);
  result.per_metre = relative_error(pairs, pairs_by_path(lengths, options.delta_m), lengths);
  result.kitti = kitti_errors(pairs);
  result.pairs = std::move(pairs);
  return result;
}

std::string EvaluationOptions::invalid_reason() const {
  return OptionCheck()
      .above("delta_s", delta_s, 0)
      .above("delta_m", delta_m, 0)
      .at_least("time_tolerance_s", time_tolerance_s, 0)
      .reason();
}

}  // namespace twofold
