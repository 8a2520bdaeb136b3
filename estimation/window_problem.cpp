#include "estimation/window_problem.hpp"

#include <cmath>
#include <limits>

#include "estimation/observation_model.hpp"
#include "estimation/pose_constraint.hpp"
#include "estimation/robust_kernel.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {

Vector3 position_w(const WindowProblem& problem, const WindowProblem::Point& point) {
  if (!(point.psi.z() > 0)) return Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
  return problem.poses[point.anchor].T_k_w.inverse() * from_inverse_depth(point.psi);
}

double observation_chi2(const WindowProblem& problem, const Vector3& position_w,
                        const WindowProblem::Observation& observation) {
  const Vector3 x = problem.poses[observation.pose].T_k_w * position_w;
  return ObservationModel(problem.rig).chi2(x, observation.pixel, observation.information);
}

double window_cost(const WindowProblem& problem, const WindowSolverOptions& options) {
  const HuberKernel kernel{options.huber_sigmas};
  double cost = 0;
  for (const auto& point : problem.points) {
    const Vector3 x_w = position_w(problem, point);
    for (int n = 0; n < point.observation_count; ++n) {
      const double chi2 = observation_chi2(problem, x_w, problem.observations[point.first_observation + n]);
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

namespace {

/// What is wrong with one entry; nullptr when nothing is. (Text is put together only for the entry named.)
const char* fault(const WindowProblem& problem, const WindowProblem::Point& point) {
  const int observations = static_cast<int>(problem.observations.size());
  if (point.anchor < 0 || point.anchor >= static_cast<int>(problem.poses.size())) return "anchor is no pose";
  if (point.observation_count < 0 || point.first_observation < 0 ||
      point.first_observation > observations - point.observation_count) {
    return "observations out of range";
  }
  return point.psi.allFinite() ? nullptr : "psi is not finite";
}

const char* fault(const WindowProblem& problem, const WindowProblem::Observation& o) {
  if (o.pose < 0 || o.pose >= static_cast<int>(problem.poses.size())) return "no such pose";
  for (int c = 0; c < 3; ++c) {
    if (!(o.information[c] >= 0) || !std::isfinite(o.information[c]))
      return "information is negative or not finite";
    if ((c < 2 || o.information[c] > 0) && !std::isfinite(o.pixel[c])) return "measurement is not finite";
  }
  return nullptr;
}

const char* fault(const WindowProblem& problem, const WindowProblem::PoseConstraint& c) {
  const int poses = static_cast<int>(problem.poses.size());
  if (c.i < 0 || c.j < 0 || c.i >= poses || c.j >= poses) return "no such pose";
  if (c.i == c.j) return "joins a pose with itself";
  return c.information.allFinite() ? nullptr : "information is not finite";
}

template <class Entry>
std::string first_fault(const WindowProblem& problem, const char* kind, const std::vector<Entry>& entries) {
  for (std::size_t n = 0; n < entries.size(); ++n) {
    if (const char* what = fault(problem, entries[n])) {
      return std::string(kind).append(" ").append(std::to_string(n)).append(": ").append(what);
    }
  }
  return {};
}

}  // namespace

std::string invalid_reason(const WindowProblem& problem) {
  std::string reason = first_fault(problem, "point", problem.points);
  if (reason.empty()) reason = first_fault(problem, "observation", problem.observations);
  if (reason.empty()) reason = first_fault(problem, "constraint", problem.constraints);
  return reason;
}

}  // namespace twofold
