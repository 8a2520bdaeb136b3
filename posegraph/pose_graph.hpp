#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "estimation/window_problem.hpp"
#include "geometry/cbh.hpp"

namespace twofold {

/// Poses T_k_w (world into k) and relative measurements between them (thesis 5.3.2). Group: SE2, SE3 or Sim3.
///
/// With E = T_j_i T_i T_j^-1 the cost is sum rho(e^T Lambda e), e an error of E in tangent order: see
/// PoseGraphError.
template <class Group>
struct PoseGraph {
  using Information = Eigen::Matrix<double, Group::kDof, Group::kDof>;
  struct Constraint {
    int i = 0;
    int j = 0;  ///< not i
    Group T_j_i;
    Information information = Information::Identity();  ///< of e, symmetric, positive semi-definite
  };

  std::vector<Group> poses;
  std::vector<Constraint> constraints;
  int origin = 0;  ///< pose that is fixed; -1: none is, and damping takes the gauge (thesis 6.2.3)
};

enum class PoseGraphError : std::uint8_t {
  kLog,  ///< e = log E  (eq. 5.15)
  /// e = (translation, twice the quaternion's vector part[, log scale]); planar: (translation, angle). Equal
  /// to the log to first order. With that of g2o, by which published costs are computed, but for a factor:
  /// its rotation in SE(3) is half of this, so a g2o information matrix Lambda becomes D Lambda D here, D =
  /// diag(1, 1, 1, 1/2, 1/2, 1/2) (fixtures/files/g2o_file.cpp).
  kComponents
};

struct PoseGraphOptions {
  PoseGraphError error = PoseGraphError::kLog;
  CbhOrder jacobian = CbhOrder::kExact;  ///< for kLog; the Jacobian of kComponents is exact
  /// Start from chordal_initialisation where its cost is lower than the graph's own, unless that is below
  /// four per error component already: then the start agrees with the measurements to twice their standard
  /// deviation. Not for Sim3.
  bool chordal_start = false;
  /// After a step, solve for the positions with the rotations fixed, a small linear problem, where that
  /// lowers the cost: it repairs what a long Gauss-Newton step bends. Not for Sim3.
  bool resolve_positions = true;
  int max_iterations = 100;         ///< steps tried, accepted or not, >= 0
  double initial_damping = 0;       ///< relative to the diagonal, >= 0; 0: Gauss-Newton until a step fails.
                                    ///< Without an origin at least 1e-9 is used
  double huber = 0;                 ///< kernel on sqrt(e^T Lambda e); <= 0: none
  double relative_decrease = 1e-6;  ///< stop when a step lowers the cost by less than this share, >= 0
  /// Once a step has lowered the cost by less than this share, its factor also serves the following steps, as
  /// long as each of them gains at most a third of the one before. 0: every step has its own factor.
  double keep_factor_below = 0.1;
  /// Called for the start and after each accepted step.
  std::function<void(int iteration, double cost)> on_cost = {};

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// sum rho(e^T Lambda e) over all constraints.
template <class Group>
[[nodiscard]] double pose_graph_cost(const PoseGraph<Group>& graph, PoseGraphError error, double huber = 0);

/// Gauss-Newton with a Levenberg-Marquardt fall-back on a pose graph. Keeps buffers and symbolic analysis
/// between calls while the structure stays. One instance a thread. Deterministic.
template <class Group>
class PoseGraphSolver {
 public:
  PoseGraphSolver();
  ~PoseGraphSolver();
  PoseGraphSolver(PoseGraphSolver&&) noexcept;
  PoseGraphSolver& operator=(PoseGraphSolver&&) noexcept;

  /// Changes graph.poses; the cost never rises. If no step lowers it they stay as they were.
  SolverSummary solve(PoseGraph<Group>& graph, const PoseGraphOptions& options);

 private:
  struct Workspace;
  std::unique_ptr<Workspace> workspace_;
};

/// Start values by composition: from the origin (pose 0 if there is none) with the pose it has, each
/// constraint in turn sets that one of its poses that was not reached yet from the other; passes are repeated
/// until nothing changes.
/// @return false when some pose was not reached
template <class Group>
bool chain_constraints(PoseGraph<Group>& graph);

}  // namespace twofold
