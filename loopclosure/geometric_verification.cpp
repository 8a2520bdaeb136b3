#include "loopclosure/geometric_verification.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "estimation/motion_only.hpp"
#include "geometry/absolute_orientation.hpp"
#include "geometry/ransac.hpp"
#include "imaging/guided_search.hpp"
#include "loopclosure/binary_descriptor.hpp"

namespace twofold {
namespace {

struct Match {
  int a = 0;
  int b = 0;
};

bool has_depth(const Eigen::Vector3f& z, const VerificationOptions& options) {
  return z.x() - z.z() > options.min_disparity_px;  // false for NaN
}

/// Best and second best partner of each of the view's corners.
struct Nearest {
  int best = -1;
  int distance = 257;
  int second = 257;
  void offer(int candidate, int d) {
    if (d < distance) {
      second = distance;
      distance = d;
      best = candidate;
    } else if (d < second) {
      second = d;
    }
  }
};

std::vector<Match> match_descriptors(const PlaceAppearance& a, const PlaceAppearance& b,
                                     const VerificationOptions& options) {
  std::vector<Nearest> of_a(a.corners.size()), of_b(b.corners.size());
  for (std::size_t i = 0; i < a.corners.size(); ++i) {
    for (std::size_t j = 0; j < b.corners.size(); ++j) {
      const int d = hamming_distance(a.corners[i].descriptor, b.corners[j].descriptor);
      of_a[i].offer(static_cast<int>(j), d);
      of_b[j].offer(static_cast<int>(i), d);
    }
  }
  std::vector<Match> matches;
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    const Nearest& nearest = of_a[i];
    if (nearest.best < 0 || nearest.distance > options.max_distance) continue;
    const auto j = static_cast<std::size_t>(nearest.best);
    if (of_b[j].best != static_cast<int>(i)) continue;
    if (nearest.distance > options.max_ratio * nearest.second) continue;
    if (!has_depth(a.z[i], options) || !has_depth(b.z[j], options)) continue;
    matches.push_back({static_cast<int>(i), nearest.best});
  }
  return matches;
}

/// Error of a measurement in units of the pixels of its level; infinite behind the camera.
double squared_error(const Rig& rig, const Vector3& x, const Eigen::Vector3f& z, int level) {
  if (!(x.z() > 1e-3)) return std::numeric_limits<double>::infinity();
  const Vector3 e = rig.project(x) - z.cast<double>();
  return e.squaredNorm() * std::ldexp(1.0, -2 * level);
}

/// For geometry/ransac.hpp: T_b_a from three points known in both frames.
class RigidEstimator {
 public:
  using Model = SE3;
  static constexpr int kSampleSize = 3;

  RigidEstimator(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                 const std::vector<Match>& matches)
      : rig_(rig), a_(a), b_(b), matches_(matches) {
    for (const Match& match : matches) {
      x_a_.push_back(rig.unproject(z_a(match).cast<double>()));
      x_b_.push_back(rig.unproject(z_b(match).cast<double>()));
    }
  }

  [[nodiscard]] int size() const { return static_cast<int>(matches_.size()); }

  void fit(std::span<const int, 3> sample, std::vector<SE3>& models) const {
    std::array<Vector3, 3> x_a, x_b;
    for (std::size_t k = 0; k < 3; ++k) {
      x_a[k] = x_a_[static_cast<std::size_t>(sample[k])];
      x_b[k] = x_b_[static_cast<std::size_t>(sample[k])];
    }
    if (const auto T_b_a = align_rigid(x_b, x_a)) models.push_back(*T_b_a);
  }

  /// The larger of the errors in either view.
  [[nodiscard]] double squared_residual(const SE3& T_b_a, int i) const {
    const auto m = static_cast<std::size_t>(i);
    const Match& match = matches_[m];
    const double in_b = squared_error(rig_, T_b_a * x_a_[m], z_b(match), level(b_, match.b));
    const double in_a = squared_error(rig_, T_b_a.inverse() * x_b_[m], z_a(match), level(a_, match.a));
    return std::max(in_a, in_b);
  }

 private:
  [[nodiscard]] const Eigen::Vector3f& z_a(const Match& m) const {
    return a_.z[static_cast<std::size_t>(m.a)];
  }
  [[nodiscard]] const Eigen::Vector3f& z_b(const Match& m) const {
    return b_.z[static_cast<std::size_t>(m.b)];
  }
  static int level(const PlaceAppearance& view, int corner) {
    return view.corners[static_cast<std::size_t>(corner)].level;
  }

  const Rig& rig_;
  const PlaceAppearance& a_;
  const PlaceAppearance& b_;
  const std::vector<Match>& matches_;
  std::vector<Vector3> x_a_, x_b_;
};

/// Best partner in b, near to where T_b_a says, of each corner of a that has depth; a corner of b serves
/// once.
/// @param expected  counts the corners of a that should be visible in b
std::vector<Match> match_guided(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                                const SE3& T_b_a, const VerificationOptions& options, int& expected) {
  std::vector<Nearest> of_b(b.corners.size());
  expected = 0;
  for (std::size_t i = 0; i < a.corners.size(); ++i) {
    if (!has_depth(a.z[i], options)) continue;
    const Vector3 x_b = T_b_a * rig.unproject(a.z[i].cast<double>());
    if (!(x_b.z() > 1e-3)) continue;
    const Vector2 uv = rig.camera.project(x_b);
    if (!rig.camera.contains(uv, kDescriptorBorder)) continue;
    ++expected;
    Nearest nearest;
    for (std::size_t j = 0; j < b.corners.size(); ++j) {
      const double radius = std::ldexp(options.guided_radius_px, b.corners[j].level);
      if ((b.corners[j].uv.cast<double>() - uv).cwiseAbs().maxCoeff() > radius) continue;
      nearest.offer(static_cast<int>(j), hamming_distance(a.corners[i].descriptor, b.corners[j].descriptor));
    }
    if (nearest.best < 0 || nearest.distance > options.guided_distance) continue;
    of_b[static_cast<std::size_t>(nearest.best)].offer(static_cast<int>(i), nearest.distance);
  }
  std::vector<Match> matches;
  for (std::size_t j = 0; j < of_b.size(); ++j) {
    if (of_b[j].best >= 0) matches.push_back({of_b[j].best, static_cast<int>(j)});
  }
  return matches;
}

SE3 refine(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
           const std::vector<Match>& matches, const SE3& T_b_a) {
  std::vector<MotionObservation> observations;
  observations.reserve(matches.size());
  for (const Match& match : matches) {
    const Eigen::Vector3f& z_b = b.z[static_cast<std::size_t>(match.b)];
    const bool has_right = std::isfinite(z_b.z());
    MotionObservation observation;
    observation.x_ref = rig.unproject(a.z[static_cast<std::size_t>(match.a)].cast<double>());
    observation.z = z_b;
    if (!has_right) observation.z.z() = 0;
    observation.information =
        measurement_information(rig, b.corners[static_cast<std::size_t>(match.b)].level, has_right);
    observations.push_back(observation);
  }
  const MotionOnlyResult result = optimise_motion(rig, observations, T_b_a, {});
  return result.converged ? result.T_c_ref : T_b_a;
}

std::vector<Match> keep_inliers(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                                const std::vector<Match>& matches, const SE3& T_b_a,
                                const VerificationOptions& options) {
  std::vector<Match> kept;
  for (const Match& match : matches) {
    const auto i = static_cast<std::size_t>(match.a);
    const auto j = static_cast<std::size_t>(match.b);
    const Vector3 x_b = T_b_a * rig.unproject(a.z[i].cast<double>());
    Eigen::Vector3f z_b = b.z[j];
    // A corner without depth in b is judged by its place in the left image alone.
    if (!std::isfinite(z_b.z()) && x_b.z() > 1e-3) z_b.z() = static_cast<float>(rig.project(x_b).z());
    const double bound = options.max_error_px * options.max_error_px;
    if (squared_error(rig, x_b, z_b, b.corners[j].level) <= bound) kept.push_back(match);
  }
  return kept;
}

/// At least Theta / 2 inliers in the upper, lower, left and right half of both images (6.4.1).
bool spread_over(const Rig& rig, const PlaceAppearance& view, const std::vector<Match>& matches,
                 int Match::*side, int min_inliers) {
  int left = 0, upper = 0;
  for (const Match& match : matches) {
    const Eigen::Vector2f& uv = view.corners[static_cast<std::size_t>(match.*side)].uv;
    left += uv.x() < 0.5F * static_cast<float>(rig.camera.width) ? 1 : 0;
    upper += uv.y() < 0.5F * static_cast<float>(rig.camera.height) ? 1 : 0;
  }
  const int count = static_cast<int>(matches.size());
  return 4 * std::min({left, count - left, upper, count - upper}) >= min_inliers;
}

}  // namespace

std::string VerificationOptions::invalid_reason() const {
  if (max_ratio <= 0 || max_ratio > 1) return fmt::format("max_ratio must be in (0, 1], is {}", max_ratio);
  if (min_inliers < 4) return fmt::format("min_inliers must be >= 4, is {}", min_inliers);
  if (max_error_px <= 0) return fmt::format("max_error_px must be > 0, is {}", max_error_px);
  if (max_iterations < 1) return fmt::format("max_iterations must be >= 1, is {}", max_iterations);
  return "";
}

std::optional<VerifiedPlace> verify_place(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                                          const VerificationOptions& options, VerificationReport* report) {
  VerificationReport unwanted;
  VerificationReport& r = report != nullptr ? *report : unwanted;
  r = {};
  if (a.z.size() != a.corners.size() || b.z.size() != b.corners.size()) return std::nullopt;
  const std::vector<Match> matches = match_descriptors(a, b, options);
  r.matches = static_cast<int>(matches.size());
  const RigidEstimator estimator(rig, a, b, matches);
  const auto found = ransac(estimator, RansacOptions{.threshold = 2 * options.max_error_px,
                                                     .max_iterations = options.max_iterations});
  if (!found) return std::nullopt;
  r.ransac_inliers = static_cast<int>(found->inliers.size());
  if (r.ransac_inliers < options.min_inliers / 3) return std::nullopt;

  SE3 T_b_a = found->model;
  std::vector<Match> inliers;
  for (const int i : found->inliers) inliers.push_back(matches[static_cast<std::size_t>(i)]);
  T_b_a = refine(rig, a, b, inliers, T_b_a);
  int expected = 0;
  for (int round = 0; round < 2; ++round) {
    const std::vector<Match> guided = match_guided(rig, a, b, T_b_a, options, expected);
    r.guided = static_cast<int>(guided.size());
    T_b_a = refine(rig, a, b, guided, T_b_a);
    inliers = keep_inliers(rig, a, b, guided, T_b_a, options);
  }
  r.inliers = static_cast<int>(inliers.size());
  r.well_spread = spread_over(rig, a, inliers, &Match::a, options.min_inliers) &&
                  spread_over(rig, b, inliers, &Match::b, options.min_inliers);
  if (r.inliers < options.min_inliers || r.inliers < options.min_inlier_share * r.guided || !r.well_spread) {
    return std::nullopt;
  }
  return VerifiedPlace{T_b_a, r.inliers};
}

}  // namespace twofold
