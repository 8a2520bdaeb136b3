#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "filters/anchored_views.hpp"

namespace twofold {

// The problem of AnchoredViews with its points side by side, as its adjustment works on them.

inline constexpr std::size_t kPointLanes = 4;
using PointLanes = Eigen::Array<double, kPointLanes, 1>;  ///< a number of each of four points
using PointTriple = std::array<PointLanes, 3>;

/// Lower triangle of a symmetric 3x3 matrix, or a triangular one.
struct PointTriangle {
  PointLanes m00, m10, m11, m20, m21, m22;
};

/// Three rows of E^T, a view's translation or rotation, against four points; after the elimination times the
/// inverse root of D.
using PointRows = std::array<PointTriple, 3>;

/// Everything that moves.
struct AnchoredState {
  std::vector<PointTriple> psi;  ///< four points each
  std::vector<SE3> T_c_a;        ///< of the views
};

/// Normal equations [D  E; E^T  C] of an AnchoredViews, points apart from poses, and how they are solved.
class BatchedViews {
 public:
  explicit BatchedViews(const AnchoredViews& views);

  [[nodiscard]] const AnchoredState& start() const { return start_; }
  void write(const AnchoredState& state, AnchoredViews& views) const;
  [[nodiscard]] double cost(const AnchoredState& state) const;
  [[nodiscard]] std::vector<double> worst_errors(const AnchoredState& state) const;

  /// The state's cost must be finite.
  void linearise(const AnchoredState& state);
  /// Of what was linearised last, before a step has used it up.
  [[nodiscard]] Eigen::MatrixXd information() const;
  /// The step with H + damping (diag H + I): multiplicative, plus a floor for depths nobody has measured yet
  /// and for the scale. Uses up what was linearised. False when the equations have
  /// no solution.
  [[nodiscard]] bool step(double damping, const AnchoredState& from, AnchoredState& to);

 private:
  /// Four points, and what does not change while they are adjusted. Those that fill the last batch up are the
  /// last point again, and weigh nothing.
  struct Batch {
    PointTriple psi_prior;
    PointTriangle prior;
    PointLanes used;  ///< 1 or 0
  };
  /// Where a view sees four points, on the plane at depth one.
  struct Seen {
    PointLanes u, v;
  };

  void add_point(std::size_t j, const AnchoredViews::Point& point);
  [[nodiscard]] PointLanes prior_error(std::size_t n, const PointTriple& psi) const;
  void linearise_view(std::size_t v, const AnchoredState& state);
  void eliminate_points(double damping);
  void eliminate_from_poses(Eigen::MatrixXd& S, Eigen::VectorXd& rhs) const;
  [[nodiscard]] std::size_t batches() const { return points_.size(); }
  [[nodiscard]] std::span<PointRows> rows(std::size_t triple) {
    return std::span(E_T_).subspan(triple * batches(), batches());
  }
  [[nodiscard]] std::span<const PointRows> rows(std::size_t triple) const {
    return std::span(E_T_).subspan(triple * batches(), batches());
  }

  double fx_, fy_;  ///< over sigma_px
  std::size_t point_count_;
  AnchoredState start_;
  std::vector<Batch> points_;
  std::vector<std::vector<Seen>> seen_;  ///< by view
  std::vector<PointTriangle> D_;         ///< after the elimination the inverse of its root
  std::vector<PointTriple> g_points_;    ///< likewise times that
  std::vector<PointRows> E_T_;           ///< two a view, each for all points
  Eigen::MatrixXd C_;                    ///< lower triangle
  Eigen::VectorXd g_poses_;
};

}  // namespace twofold
