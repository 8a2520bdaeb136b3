#include "estimation/window_problem.hpp"

#include <cmath>
#include <limits>

#include "estimation/observation_model.hpp"
#include "estimation/pose_constraint.hpp"
#include "estimation/robust_kernel.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {

double observation_chi2(const WindowProblem& problem, const WindowProblem::Point& point,
                        const WindowProblem::Observation& observation) {
  if (!(point.psi.z() > 0)) return std::numeric_limits<double>::infinity();
  const SE3& T_i_w = problem.poses[observation.pose].T_k_w;
  const SE3& T_a_w = problem.poses[point.anchor].T_k_w;
  const Vector3 x = T_i_w * (T_a_w.inverse() * from_inverse_depth(point.psi));
  return ObservationModel(problem.rig).chi2(x, observation.z, observation.information);
}

double window_cost(const WindowProblem& problem, const WindowSolverOptions& options) {
  const HuberKernel kernel{options.huber_px};
  double cost = 0;
  for (const auto& point : problem.points) {
    for (int n = 0; n < point.observation_count; ++n) {
      const double chi2 = observation_chi2(problem, point, problem.observations[point.first_observation + n]);
      if (std::isfinite(chi2)) cost += kernel.rho(chi2);
    }
  }
  const HuberKernel constraint_kernel{options.constraint_huber};
  for (const auto& c : problem.constraints) {
    const Vector6 v = pose_constraint_error(c.T_j_i, problem.poses[c.i].T_k_w, problem.poses[c.j].T_k_w);
    cost += constraint_kernel.rho(v.dot(c.information * v));
  }
  return cost;
}

std::string invalid_reason(const WindowProblem& problem) {
  const int poses = static_cast<int>(problem.poses.size());
  const int observations = static_cast<int>(problem.observations.size());
  const auto is_pose = [poses](int i) { return i >= 0 && i < poses; };
  for (std::size_t k = 0; k < problem.points.size(); ++k) {
    const auto& point = problem.points[k];
    const std::string name = "point " + std::to_string(k) + ": ";
    if (!is_pose(point.anchor)) return name + "no pose " + std::to_string(point.anchor) + " for its anchor";
    if (point.observation_count < 0 || point.first_observation < 0 ||
        point.first_observation > observations - point.observation_count) {
      return name + "observations out of range";
    }
    if (!point.psi.allFinite()) return name + "psi is not finite";
  }
  for (std::size_t n = 0; n < problem.observations.size(); ++n) {
    const auto& o = problem.observations[n];
    const std::string name = "observation " + std::to_string(n) + ": ";
    if (!is_pose(o.pose)) return name + "no pose " + std::to_string(o.pose);
    if (!o.information.allFinite() || o.information.minCoeff() < 0) return name + "information is negative";
    if (!o.z.head<2>().allFinite() || (o.information.z() > 0 && !std::isfinite(o.z.z()))) {
      return name + "measurement is not finite";
    }
  }
  for (std::size_t n = 0; n < problem.constraints.size(); ++n) {
    const auto& c = problem.constraints[n];
    const std::string name = "constraint " + std::to_string(n) + ": ";
    if (!is_pose(c.i) || !is_pose(c.j)) return name + "no such pose";
    if (c.i == c.j) return name + "joins a pose with itself";
    if (!c.information.allFinite()) return name + "information is not finite";
  }
  return {};
}

}  // namespace twofold
