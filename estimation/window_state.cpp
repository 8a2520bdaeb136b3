#include "estimation/window_state.hpp"

#include <cmath>
#include <limits>

#include "estimation/observation_model.hpp"
#include "estimation/robust_kernel.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

/// log(T_ji T_i T_j^-1), normalised once only.
Vector6 constraint_error(const SE3& T_j_i, const SE3& T_i_w, const SE3& T_j_w) {
  const Eigen::Quaterniond& q_j_i = T_j_i.so3().quaternion();
  const Eigen::Quaterniond q_i_j = T_i_w.so3().quaternion() * T_j_w.so3().quaternion().conjugate();
  const Vector3 t_i_j = T_i_w.translation() - q_i_j * T_j_w.translation();
  return SE3(SO3(q_j_i * q_i_j), T_j_i.translation() + q_j_i * t_i_j).log();
}

double track_cost(const WindowLayout& layout, const WindowLayout::Track& track, const ObservationModel& model,
                  const HuberKernel& kernel, const RigidMotion* relative, const Vector3& psi) {
  const Vector3 y = from_inverse_depth(psi);
  const WindowLayout::Observation* first = &layout.observations()[track.first_observation];
  double sum = 0;
  for (const auto* o = first; o != first + track.observation_count; ++o) {
    const RigidMotion& T = relative[o->slot];
    sum += kernel.rho(model.chi2(T.R * y + T.t, o->pixel, o->information));
  }
  return sum;
}

double points_cost(const WindowLayout& layout, const ObservationModel& model, const HuberKernel& kernel,
                   const std::vector<Vector3>& psi_before, WindowState& values) {
  double cost = 0;
  for (const auto& group : layout.groups()) {
    const RigidMotion* relative = &values.relative[group.first_slot];
    for (int k = group.first_track; k < group.first_track + group.track_count; ++k) {
      const auto cost_at = [&](const Vector3& psi) {
        return track_cost(layout, layout.tracks()[k], model, kernel, relative, psi);
      };
      double sum = cost_at(values.psi[k]);
      if (!std::isfinite(sum)) sum = cost_at(values.psi[k] = psi_before[k]);
      if (!std::isfinite(sum)) return std::numeric_limits<double>::infinity();
      cost += sum;
    }
  }
  return cost;
}

}  // namespace

void WindowState::relate(const WindowProblem& problem, const WindowLayout& layout) {
  matrices.resize(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) matrices[i] = {poses[i].rotation(), poses[i].translation()};
  relative.resize(layout.slots().size());
  for (const auto& group : layout.groups()) {
    for (int s = group.first_slot; s < group.first_slot + group.slot_count; ++s) {
      const int i = layout.slots()[s].pose;
      relative[s] = i == group.anchor ? RigidMotion{Matrix3::Identity(), Vector3::Zero()}
                                      : relative_motion(matrices[i], matrices[group.anchor]);
    }
  }
  constraint_errors.resize(problem.constraints.size());
  for (std::size_t n = 0; n < problem.constraints.size(); ++n) {
    const auto& c = problem.constraints[n];
    constraint_errors[n] = constraint_error(c.T_j_i, poses[c.i], poses[c.j]);
  }
}

double window_state_cost(const WindowProblem& problem, const WindowLayout& layout,
                         const WindowSolverOptions& options, const std::vector<Vector3>& psi_before,
                         WindowState& values) {
  double sum = points_cost(layout, ObservationModel(problem.rig), HuberKernel{options.huber_sigmas},
                           psi_before, values);
  const HuberKernel kernel{options.constraint_huber};
  for (std::size_t n = 0; n < problem.constraints.size(); ++n) {
    const Vector6& v = values.constraint_errors[n];
    sum += kernel.rho(v.dot(problem.constraints[n].information * v));
  }
  return sum;
}

}  // namespace twofold
