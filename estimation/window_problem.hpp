#pragma once

#include <functional>
#include <string>
#include <vector>

#include "camera/measurement.hpp"
#include "camera/rig.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// Double-window problem, eq. 6.4:
///   chi2 = sum rho(|z_ik - z(T_i T_a(k)^-1 Pi(psi_k))|^2)  +  sum v_ji^T Lambda_ji v_ji,
///   v_ji = log(T_ji T_i T_j^-1).
/// Poses T_i map world points into camera i; points are anchored inverse depth points. Indices are positions
/// in the vectors below. With no pose-pose constraints this is bundle adjustment; with no points a pose
/// graph.
struct WindowProblem {
  struct Pose {
    SE3 T_k_w;
    bool fixed = false;  ///< does not move during the optimisation
  };
  /// That a pose sees a point, with the measurement; those of one point stand together.
  struct Observation {
    int pose = 0;
    StereoPixelF pixel{0, 0, 0};           ///< u_r is ignored unless weighs_right(information)
    Eigen::Vector3f information{1, 1, 1};  ///< diagonal of Lambda_z [1/px^2]
  };
  struct Point {
    int anchor = 0;  ///< pose index of a(k)
    Vector3 psi{0, 0, 1};
    int first_observation = 0;
    int observation_count = 0;
  };
  struct PoseConstraint {
    int i = 0;
    int j = 0;
    SE3 T_j_i;
    Matrix6 information = Matrix6::Identity();  ///< of v_ji, tangent order (v, omega)
  };

  Rig rig;
  std::vector<Pose> poses;
  std::vector<Point> points;
  std::vector<Observation> observations;
  std::vector<PoseConstraint> constraints;
};

struct WindowSolverOptions {
  int max_iterations = 3;           ///< Levenberg-Marquardt steps, accepted or not, >= 1
  double initial_damping = 1e-4;    ///< relative to each parameter's diagonal entry of the normal equations,
                                    ///< >= 0; also fixes the gauge (thesis 6.2.3)
  double huber_sigmas = 2.0;        ///< kernel on the whitened reprojection error norm; <= 0: none
  double constraint_huber = 0;      ///< kernel on sqrt(v^T Lambda v); <= 0: none
  double relative_decrease = 1e-6;  ///< stop when a step lowers the cost by less than this share, >= 0
  /// WindowSolver asks after each iteration, if set: iterations so far and present cost; false stops. For
  /// time budgets and measurements.
  std::function<bool(int iterations, double cost)> keep_going;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct SolverSummary {
  enum class Termination { kConverged, kIterationLimit, kNoStepFound, kEmptyProblem };
  double initial_cost = 0;  ///< robustified chi2
  double final_cost = 0;
  int iterations = 0;
  int accepted_steps = 0;
  Termination termination = Termination::kEmptyProblem;
};

/// Where a point is in the world at the problem's present values [m]; NaN without a positive inverse depth.
[[nodiscard]] Vector3 position_w(const WindowProblem& problem, const WindowProblem::Point& point);

/// Whitened squared error of one observation of a point; infinity behind the camera, or for a NaN.
[[nodiscard]] double observation_chi2(const WindowProblem& problem, const Vector3& position_w,
                                      const WindowProblem::Observation& observation);

/// Robustified chi2 of the whole problem (eq. 6.4); observations behind their camera are left out, as the
/// solvers leave them out.
[[nodiscard]] double window_cost(const WindowProblem& problem, const WindowSolverOptions& options);

/// Empty when indices are in range and numbers finite; otherwise names the first entry that is wrong.
[[nodiscard]] std::string invalid_reason(const WindowProblem& problem);

}  // namespace twofold
