#include "loopclosure/geometric_verification.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "estimation/motion_only.hpp"
#include "geometry/absolute_orientation.hpp"
#include "geometry/agreement_graph.hpp"
#include "geometry/essential_matrix.hpp"
#include "geometry/ransac.hpp"
#include "imaging/binary_descriptor.hpp"
#include "imaging/guided_search.hpp"

namespace twofold {
namespace {

/// A corner of b and the corner of one of the place's views that it is taken for.
struct Match {
  int view = 0;  ///< of the place
  int corner = 0;
  int b = 0;
  Vector3 x_a;  ///< the place's point, in the frame of its own view [m]
};

bool has_depth(const Eigen::Vector3f& z, const VerificationOptions& options) {
  return z.x() - z.z() > options.min_disparity_px;  // false for NaN
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<Match> match_descriptors(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                                     const VerificationOptions& options, bool depth_in_b) {
  std::vector<NearestDescriptor> of_a, of_b;
  find_nearest(a.corners, b.corners, of_a, of_b);
  std::vector<Match> matches;
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    const NearestDescriptor& nearest = of_a[i];
    if (nearest.best < 0 || nearest.distance > options.max_distance) continue;
    const auto j = static_cast<std::size_t>(nearest.best);
    if (of_b[j].best != static_cast<int>(i)) continue;
    if (!has_depth(a.z[i], options) || (depth_in_b && !has_depth(b.z[j], options))) continue;
    matches.push_back({0, static_cast<int>(i), nearest.best, rig.unproject(a.z[i].cast<double>())});
  }
  return matches;
}

/// Error of a measurement in units of the pixels of its level, squared; infinite behind the camera.
/// @param per_pixel  2^(-2 level)
double squared_error(const Rig& rig, const Vector3& x, const Eigen::Vector3f& z, double per_pixel) {
  if (!in_front_of_camera(x)) return std::numeric_limits<double>::infinity();
  const Vector3 e = rig.project(x) - z.cast<double>();
  const double squared = rig.kind == SensorKind::kMono ? e.head<2>().squaredNorm() : e.squaredNorm();
  return squared * per_pixel;
}

double per_squared_pixel(int level) {
  return std::ldexp(1.0, -2 * level);
}

/// By how much directions in the image turn from view a to view b: what of the rotation is about the axis.
double turn_of(const Matrix3& R_b_a) {
  return std::atan2(R_b_a(1, 0) - R_b_a(0, 1), R_b_a(0, 0) + R_b_a(1, 1));
}

bool nearly_same_direction(double angle_0, double angle_1, double bound) {
  constexpr double kRound = 2 * std::numbers::pi;
  const double apart = angle_0 - angle_1;
  return std::abs(apart - kRound * std::nearbyint(apart / kRound)) <=
         bound;  // remainder() takes 5 times as long
}

double radians(double degrees) {
  return degrees * std::numbers::pi / 180;
}

/// A similarity, and what each residual needs of it.
struct TwoWaySimilarity {
  explicit TwoWaySimilarity(const Sim3& S)
      : S_b_a(S), S_a_b(S.inverse()), turn(turn_of(S.without_scale().rotation())) {}
  Sim3 S_b_a, S_a_b;
  double turn;
};

/// For geometry/ransac.hpp: S_b_a from three points known in both frames, of scale 1 unless there is one
/// camera.
class SimilarityEstimator {
 public:
  using Model = TwoWaySimilarity;
  static constexpr int kSampleSize = 3;

  SimilarityEstimator(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                      const std::vector<Match>& matches, const VerificationOptions& options)
      : rig_(rig),
        shortest_(std::pow(std::max(0.0, 1 - options.max_stretch), 2)),
        max_turn_(radians(options.max_turn_deg)),
        outlier_(options.ransac_error_px * options.ransac_error_px) {
    for (const Match& match : matches) {
      const auto i = static_cast<std::size_t>(match.corner);
      const auto j = static_cast<std::size_t>(match.b);
      pairs_.push_back({match.x_a, rig.unproject(b.z[j].cast<double>()), a.z[i], b.z[j],
                        per_squared_pixel(a.corners[i].level), per_squared_pixel(b.corners[j].level),
                        double{b.corners[j].angle} - a.corners[i].angle});
    }
  }

  [[nodiscard]] int size() const { return static_cast<int>(pairs_.size()); }

  /// Which matches one motion of a known scale can explain: they keep their distance and turn alike.
  [[nodiscard]] AgreementGraph agreements() const {
    AgreementGraph graph(pairs_.size());
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      for (std::size_t j = i + 1; j < pairs_.size(); ++j) {
        if (turn_alike(pairs_[i], pairs_[j]) && as_long((pairs_[i].x_a - pairs_[j].x_a).squaredNorm(),
                                                        (pairs_[i].x_b - pairs_[j].x_b).squaredNorm()))
          graph.join(i, j);
      }
    }
    return graph;
  }

  void fit(std::span<const int, 3> sample, std::vector<Model>& models) const {
    const bool scale_known = rig_.kind != SensorKind::kMono;
    std::array<Vector3, 3> x_a, x_b;
    double scale = 1;  // of the first side, squared
    for (std::size_t k = 0; k < 3; ++k) {
      const Pair& pair = pairs_[static_cast<std::size_t>(sample[k])];
      const Pair& next = pairs_[static_cast<std::size_t>(sample[(k + 1) % 3])];
      x_a[k] = pair.x_a;
      x_b[k] = pair.x_b;
      const double in_b = (pair.x_b - next.x_b).squaredNorm();
      double in_a = (pair.x_a - next.x_a).squaredNorm();
      if (!scale_known && k == 0) scale = in_b / in_a;
      in_a *= scale;
      if (!as_long(in_a, in_b) || !turn_alike(pair, next)) return;
    }
    if (scale_known) {
      if (const auto T_b_a = align_rigid(x_b, x_a)) models.emplace_back(Sim3(*T_b_a));
    } else if (const auto S_b_a = align_similarity(x_b, x_a)) {
      models.emplace_back(*S_b_a);
    }
  }

  /// The larger of the errors in either view; of outliers, one that makes them such.
  [[nodiscard]] double squared_residual(const Model& model, int i) const {
    const Pair& pair = pairs_[static_cast<std::size_t>(i)];
    if (!nearly_same_direction(pair.turn, model.turn, max_turn_)) return 2 * outlier_;
    const double in_b = squared_error(rig_, model.S_b_a * pair.x_a, pair.z_b, pair.per_pixel_b);
    if (in_b > outlier_) return in_b;
    return std::max(squared_error(rig_, model.S_a_b * pair.x_b, pair.z_a, pair.per_pixel_a), in_b);
  }

 private:
  /// Of a match, both points, each in the frame of its own view, and both measurements.
  struct Pair {
    Vector3 x_a, x_b;
    Eigen::Vector3f z_a, z_b;
    double per_pixel_a = 1, per_pixel_b = 1;
    double turn = 0;  ///< of the corner, from a to b
  };

  [[nodiscard]] bool as_long(double squared_a, double squared_b) const {
    return squared_a >= shortest_ * squared_b && squared_b >= shortest_ * squared_a;
  }
  [[nodiscard]] bool turn_alike(const Pair& i, const Pair& j) const {
    return nearly_same_direction(i.turn, j.turn, 2 * max_turn_);
  }

  const Rig& rig_;
  double shortest_;  ///< side over the longer of the two, squared
  double max_turn_;
  double outlier_;
  std::vector<Pair> pairs_;
};

/// What RANSAC would find if it drew every sample that can be right: where few matches are, it misses them,
/// or not, by its seed.
std::optional<RansacResult<TwoWaySimilarity>> best_of_all_samples(const SimilarityEstimator& estimator,
                                                                  const VerificationOptions& options) {
  const double threshold = options.ransac_error_px * options.ransac_error_px;
  std::optional<RansacResult<TwoWaySimilarity>> best;
  double least = std::numeric_limits<double>::infinity();
  std::vector<TwoWaySimilarity> models;
  std::vector<int> inliers;
  for (const auto& sample : estimator.agreements().triples(static_cast<std::size_t>(options.max_samples))) {
    models.clear();
    estimator.fit(sample, models);
    if (models.empty()) continue;
    inliers.clear();
    double score = 0;  // as in geometry/ransac.hpp
    for (int i = 0; i < estimator.size() && score < least; ++i) {
      const double squared = estimator.squared_residual(models[0], i);
      if (squared <= threshold) inliers.push_back(i);
      score += std::min(squared, threshold);
    }
    if (score >= least) continue;
    least = score;
    best = RansacResult<TwoWaySimilarity>{models[0], inliers, 0};
  }
  return best;
}

/// The corners of a view in square cells, a grid for each level, so that a search looks at a few of them
/// only.
class CornerGrid {
 public:
  /// @param radius_px  the largest that is searched, pixels of a corner's level
  CornerGrid(const PinholeCamera& camera, const std::vector<DescribedCorner>& corners, double radius_px) {
    std::vector<int> order(corners.size());  // from top to bottom
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
      return corners[static_cast<std::size_t>(a)].uv.y() < corners[static_cast<std::size_t>(b)].uv.y();
    });
    for (int level = 0; level < ImagePyramid::kLevels; ++level) {
      Level grid;
      grid.pixel = std::ldexp(1.0, level);
      grid.per_cell = 1 / (2 * grid.pixel * radius_px);  // a search meets four cells at most
      grid.columns = static_cast<int>(camera.width * grid.per_cell) + 1;
      grid.rows = static_cast<int>(camera.height * grid.per_cell) + 1;
      fill(grid, level, corners, order);
      if (!grid.entries.empty()) levels_.push_back(std::move(grid));
    }
  }

  /// The corner most like `descriptor` within `radius_px` pixels of its own level around uv, the upper one
  /// among equals.
  [[nodiscard]] NearestDescriptor nearest(const Vector2& uv, const BinaryDescriptor& descriptor,
                                          double radius_px) const {
    NearestDescriptor nearest;
    int rank = 0;
    for (const Level& grid : levels_) {
      const double radius = radius_px * grid.pixel;
      const Eigen::Array2i first = grid.cell_of(uv.array() - radius),
                           last = grid.cell_of(uv.array() + radius);
      for (int row = first.y(); row <= last.y(); ++row) {
        const int in_row = row * grid.columns;
        const int begin = grid.begin[static_cast<std::size_t>(in_row + first.x())];
        const int end = grid.begin[static_cast<std::size_t>(in_row + last.x() + 1)];
        for (int e = begin; e < end; ++e) {
          const Entry& entry = grid.entries[static_cast<std::size_t>(e)];
          if ((entry.uv - uv).cwiseAbs().maxCoeff() > radius) continue;
          const int distance = hamming_distance(descriptor, *entry.descriptor);
          if (distance > nearest.distance || (distance == nearest.distance && entry.rank > rank)) continue;
          nearest = {entry.corner, distance};
          rank = entry.rank;
        }
      }
    }
    return nearest;
  }

 private:
  struct Entry {
    Vector2 uv;
    int corner = 0;
    int rank = 0;  ///< from top to bottom
    const BinaryDescriptor* descriptor = nullptr;
  };
  struct Level {
    double pixel = 1;     ///< of the level, in those of level 0
    double per_cell = 1;  ///< cells a pixel of level 0
    int columns = 1, rows = 1;
    std::vector<Entry> entries;  ///< by cell, row by row
    std::vector<int> begin;      ///< of each cell's entries, and the end of the last

    [[nodiscard]] Eigen::Array2i cell_of(const Eigen::Array2d& uv) const {
      const Eigen::Array2d cell = (uv * per_cell).max(0).min(Eigen::Array2d(columns - 1, rows - 1));
      return cell.cast<int>();
    }
    [[nodiscard]] std::size_t index_of(const Vector2& uv) const {
      const Eigen::Array2i cell = cell_of(uv.array());
      return static_cast<std::size_t>(cell.y() * columns + cell.x());
    }
  };

  /// Sorts the level's corners into its cells, by counting.
  static void fill(Level& grid, int level, const std::vector<DescribedCorner>& corners,
                   const std::vector<int>& order) {
    const auto on_level = [&](int j) { return corners[static_cast<std::size_t>(j)].level == level; };
    grid.begin.assign(static_cast<std::size_t>(grid.columns * grid.rows) + 1, 0);
    for (const int j : order) {
      if (on_level(j))
        ++grid.begin[grid.index_of(corners[static_cast<std::size_t>(j)].uv.cast<double>()) + 1];
    }
    std::partial_sum(grid.begin.begin(), grid.begin.end(), grid.begin.begin());
    grid.entries.resize(static_cast<std::size_t>(grid.begin.back()));
    std::vector<int> next(grid.begin.begin(), grid.begin.end() - 1);
    for (std::size_t rank = 0; rank < order.size(); ++rank) {
      const int j = order[rank];
      if (!on_level(j)) continue;
      const DescribedCorner& corner = corners[static_cast<std::size_t>(j)];
      const Vector2 uv = corner.uv.cast<double>();
      const auto at = static_cast<std::size_t>(next[grid.index_of(uv)]++);
      grid.entries[at] = {uv, j, static_cast<int>(rank), &corner.descriptor};
    }
  }

  std::vector<Level> levels_;  ///< those that have corners
};

/// A corner of the place that has depth.
struct PlacePoint {
  Match match;  ///< of no corner of b yet
  const BinaryDescriptor* descriptor = nullptr;
  double angle = 0;  ///< as the place's own view would have it, if it saw the corner
};

std::vector<PlacePoint> points_of(const Rig& rig, std::span<const PlacedView> place,
                                  const VerificationOptions& options) {
  std::vector<PlacePoint> points;
  for (std::size_t v = 0; v < place.size(); ++v) {
    const PlaceAppearance& view = *place[v].appearance;
    const SE3 T_a_v = place[v].T_v_a.inverse();
    const double turn = turn_of(T_a_v.rotation());
    for (std::size_t i = 0; i < view.corners.size(); ++i) {
      if (!has_depth(view.z[i], options)) continue;
      const Vector3 x_a = T_a_v * rig.unproject(view.z[i].cast<double>());
      points.push_back({{static_cast<int>(v), static_cast<int>(i), 0, x_a},
                        &view.corners[i].descriptor,
                        view.corners[i].angle + turn});
    }
  }
  return points;
}

/// Best partner in b, near to where T_b_a says, of each point of the place, if it is turned as T_b_a says; a
/// corner of b serves once.
std::vector<Match> match_guided(const Rig& rig, const std::vector<PlacePoint>& place,
                                const PlaceAppearance& b, const CornerGrid& corners_of_b, const SE3& T_b_a,
                                double radius_px, const VerificationOptions& options) {
  std::vector<Match> offered;
  std::vector<NearestDescriptor> of_b(b.corners.size());
  const double turn = turn_of(T_b_a.rotation());
  const double max_turn = radians(options.max_turn_deg);
  for (const PlacePoint& point : place) {
    const Vector3 x_b = T_b_a * point.match.x_a;
    const auto uv = rig.camera.find_in_view(x_b, kDescriptorBorder);
    if (!uv) continue;
    const NearestDescriptor nearest = corners_of_b.nearest(*uv, *point.descriptor, radius_px);
    if (nearest.best < 0 || nearest.distance > options.guided_distance) continue;
    const auto j = static_cast<std::size_t>(nearest.best);
    if (!nearly_same_direction(double{b.corners[j].angle}, point.angle + turn, max_turn)) continue;
    of_b[j].offer(static_cast<int>(offered.size()), nearest.distance);
    offered.push_back(point.match);
    offered.back().b = nearest.best;
  }
  std::vector<Match> matches;
  for (const NearestDescriptor& nearest : of_b) {
    if (nearest.best >= 0) matches.push_back(offered[static_cast<std::size_t>(nearest.best)]);
  }
  return matches;
}

SE3 refine(const Rig& rig, const PlaceAppearance& b, const std::vector<Match>& matches, const SE3& T_b_a) {
  std::vector<MotionObservation> observations;
  observations.reserve(matches.size());
  for (const Match& match : matches) {
    const Eigen::Vector3f& z_b = b.z[static_cast<std::size_t>(match.b)];
    const int level = b.corners[static_cast<std::size_t>(match.b)].level;
    observations.push_back({match.x_a, z_b, rig.information(z_b, level)});
  }
  const MotionOnlyResult result = optimise_motion(rig, observations, T_b_a, {});
  return result.converged ? result.T_c_ref : T_b_a;
}

std::vector<Match> keep_inliers(const Rig& rig, const PlaceAppearance& b, const std::vector<Match>& matches,
                                const SE3& T_b_a, const VerificationOptions& options) {
  std::vector<Match> kept;
  for (const Match& match : matches) {
    const auto j = static_cast<std::size_t>(match.b);
    const Vector3 x_b = T_b_a * match.x_a;
    Eigen::Vector3f z_b = b.z[j];
    // A corner without depth in b is judged by its place in the left image alone.
    if (!std::isfinite(z_b.z()) && in_front_of_camera(x_b))
      z_b.z() = static_cast<float>(rig.project(x_b).z());
    const double bound = options.max_error_px * options.max_error_px;
    if (squared_error(rig, x_b, z_b, per_squared_pixel(b.corners[j].level)) <= bound) kept.push_back(match);
  }
  return kept;
}

/// Enough corners in the upper, lower, left and right half of the image.
class Spread {
 public:
  explicit Spread(const PinholeCamera& camera) : centre_(0.5F * camera.width, 0.5F * camera.height) {}
  void add(const Eigen::Vector2f& uv) {
    ++(uv.x() < centre_.x() ? left_ : right_);
    ++(uv.y() < centre_.y() ? upper_ : lower_);
  }
  [[nodiscard]] int least() const { return std::min({left_, right_, upper_, lower_}); }

 private:
  Eigen::Vector2f centre_;
  int left_ = 0, right_ = 0, upper_ = 0, lower_ = 0;
};

bool well_spread(const Rig& rig, std::span<const PlacedView> place, const PlaceAppearance& b,
                 const std::vector<Match>& matches, int min_in_half) {
  Spread in_place(rig.camera), in_b(rig.camera);
  for (const Match& match : matches) {
    const PlaceAppearance& view = *place[static_cast<std::size_t>(match.view)].appearance;
    in_place.add(view.corners[static_cast<std::size_t>(match.corner)].uv);
    in_b.add(b.corners[static_cast<std::size_t>(match.b)].uv);
  }
  return std::min(in_place.least(), in_b.least()) >= min_in_half;
}

/// Pose of a camera that knows no depths at all: by the directions of the matches (five points), and by the
/// length of the way that gives the place's points the depths they have.
std::optional<SE3> pose_by_directions(const Rig& rig, const PlaceAppearance& b,
                                      const std::vector<Match>& matches, const VerificationOptions& options,
                                      VerificationReport& report) {
  std::vector<Vector3> bearings_a, bearings_b;
  for (const Match& match : matches) {
    bearings_a.push_back(match.x_a / match.x_a.z());
    bearings_b.push_back(
        rig.camera.unproject(b.z[static_cast<std::size_t>(match.b)].head<2>().cast<double>()));
  }
  RansacOptions ransac;
  ransac.threshold = options.max_error_px / rig.camera.fx;
  const auto epipolar = estimate_relative_pose(bearings_a, bearings_b, ransac);
  if (!epipolar) return std::nullopt;
  report.ransac_inliers = static_cast<int>(epipolar->inliers.size());
  // Five points always agree with a pose of their own.
  if (report.ransac_inliers < std::max(options.min_hypothesis, 6)) return std::nullopt;
  const SE3& T_b_a = epipolar->T_b_a;
  std::vector<Match> inliers;
  std::vector<double> lengths;
  for (const int i : epipolar->inliers) {
    const auto m = static_cast<std::size_t>(i);
    inliers.push_back(matches[m]);
    // R x_a + length t is along the bearing: least squares for the length.
    const Vector3 across = bearings_b[m].cross(T_b_a.translation());
    lengths.push_back(-across.dot(bearings_b[m].cross(T_b_a.so3() * matches[m].x_a)) / across.squaredNorm());
  }
  return refine(rig, b, inliers, SE3(T_b_a.so3(), median(std::move(lengths)) * T_b_a.translation()));
}

/// Pose that explains most of the matches between b and the place's own view.
std::optional<SE3> find_hypothesis(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                                   const VerificationOptions& options, VerificationReport& report) {
  const bool depth_in_b =
      rig.kind != SensorKind::kMono ||
      std::any_of(b.z.begin(), b.z.end(), [&](const auto& z) { return has_depth(z, options); });
  const std::vector<Match> matches = match_descriptors(rig, a, b, options, depth_in_b);
  report.matches = static_cast<int>(matches.size());
  if (!depth_in_b) return pose_by_directions(rig, b, matches, options, report);
  const SimilarityEstimator estimator(rig, a, b, matches, options);
  const auto found = rig.kind != SensorKind::kMono
                         ? best_of_all_samples(estimator, options)
                         : ransac(estimator, RansacOptions{.threshold = options.ransac_error_px,
                                                           .max_iterations = options.max_iterations});
  if (!found) return std::nullopt;
  report.ransac_inliers = static_cast<int>(found->inliers.size());
  if (report.ransac_inliers < options.min_hypothesis) return std::nullopt;
  std::vector<Match> inliers;
  for (const int i : found->inliers) inliers.push_back(matches[static_cast<std::size_t>(i)]);
  return refine(rig, b, inliers, found->model.S_b_a.without_scale());
}

/// Median ratio of the depths that b has to those that the place gives it; 1 unless there is one camera.
double scale_of(const Rig& rig, const PlaceAppearance& b, const std::vector<Match>& matches, const SE3& T_b_a,
                const VerificationOptions& options) {
  if (rig.kind != SensorKind::kMono) return 1;
  std::vector<double> ratios;
  for (const Match& match : matches) {
    const Eigen::Vector3f& z_b = b.z[static_cast<std::size_t>(match.b)];
    if (has_depth(z_b, options))
      ratios.push_back(rig.depth_from_disparity(z_b.x() - z_b.z()) / (T_b_a * match.x_a).z());
  }
  return ratios.empty() ? 1 : median(std::move(ratios));
}

bool has_positions(const PlaceAppearance& view) {
  return view.z.size() == view.corners.size();
}

}  // namespace

std::optional<VerifiedPlace> verify_place(const Rig& rig, std::span<const PlacedView> place,
                                          const PlaceAppearance& b, const VerificationOptions& options,
                                          VerificationReport* report) {
  VerificationReport unwanted;
  VerificationReport& r = report != nullptr ? *report : unwanted;
  r = {};
  for (const PlacedView& view : place) {
    if (!has_positions(*view.appearance)) return std::nullopt;
  }
  if (place.empty() || !has_positions(b)) return std::nullopt;
  const auto hypothesis = find_hypothesis(rig, *place[0].appearance, b, options, r);
  if (!hypothesis) return std::nullopt;

  SE3 T_b_a = *hypothesis;
  const std::vector<PlacePoint> points = points_of(rig, place, options);
  const CornerGrid corners_of_b(rig.camera, b.corners, options.guided_radius_px);
  std::vector<Match> inliers;
  for (const double radius : {1.0, 0.5, 0.5}) {
    const std::vector<Match> guided =
        match_guided(rig, points, b, corners_of_b, T_b_a, radius * options.guided_radius_px, options);
    r.guided = static_cast<int>(guided.size());
    T_b_a = refine(rig, b, guided, T_b_a);
    inliers = keep_inliers(rig, b, guided, T_b_a, options);
  }
  r.inliers = static_cast<int>(inliers.size());
  r.well_spread = well_spread(rig, place, b, inliers, options.min_in_half);
  if (r.inliers < options.min_inliers || r.inliers < options.min_inlier_share * r.guided || !r.well_spread) {
    return std::nullopt;
  }
  return VerifiedPlace{T_b_a, scale_of(rig, b, inliers, T_b_a, options), r.inliers};
}

}  // namespace twofold
