#include <Eigen/Cholesky>
#include <cmath>

#include "base/check.hpp"
#include "estimation/levenberg_marquardt.hpp"
#include "estimation/observation_model.hpp"
#include "estimation/window_solver.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

/// One observation of the point at hand, its pose relative to the anchor worked out.
struct PointView {
  Matrix3 R_i_a;
  Vector3 t_i_a;
  const WindowProblem::Observation* observation;
};

struct PointEquations {
  Matrix3 H = Matrix3::Zero();
  Vector3 g = Vector3::Zero();
};

double point_cost(const ObservationModel& model, const HuberKernel& kernel,
                  const std::vector<PointView>& views, const Vector3& psi) {
  if (!(psi.z() > 0)) return std::numeric_limits<double>::infinity();
  const Vector3 y = from_inverse_depth(psi);
  double cost = 0;
  for (const PointView& view : views) {
    const Vector3 x = view.R_i_a * y + view.t_i_a;
    cost += kernel.rho(model.chi2(x, view.observation->pixel, view.observation->information));
  }
  return cost;
}

PointEquations point_equations(const ObservationModel& model, const HuberKernel& kernel,
                               const std::vector<PointView>& views, const Vector3& psi) {
  PointEquations sum;
  const Vector3 y = from_inverse_depth(psi);
  for (const PointView& view : views) {
    const Vector3 x = view.R_i_a * y + view.t_i_a;
    const auto terms = model.linearise(x, view.observation->pixel, view.observation->information, kernel);
    const Matrix3 J = inverse_depth_jacobian(view.R_i_a, psi);
    Matrix3 SJ;
    for (int c = 0; c < 3; ++c) SJ.col(c) = terms.apply(J.col(c));
    sum.H += J.transpose() * SJ;
    sum.g += J.transpose() * terms.force;
  }
  return sum;
}

/// Views of a point that lie in front of their camera at the start; the others cannot be linearised.
void collect_views(const WindowProblem& problem, const WindowProblem::Point& point,
                   const ObservationModel& model, std::vector<PointView>& views) {
  views.clear();
  const SE3 T_w_a = problem.poses[point.anchor].T_k_w.inverse();
  const Vector3 y = from_inverse_depth(point.psi);
  for (int n = 0; n < point.observation_count; ++n) {
    const auto& observation = problem.observations[point.first_observation + n];
    const SE3 T_i_a =
        observation.pose == point.anchor ? SE3() : problem.poses[observation.pose].T_k_w * T_w_a;
    if (std::isfinite(model.chi2(T_i_a * y, observation.pixel, observation.information))) {
      views.push_back({T_i_a.rotation(), T_i_a.translation(), &observation});
    }
  }
}

void optimise_point(const ObservationModel& model, const HuberKernel& kernel,
                    const std::vector<PointView>& views, const WindowSolverOptions& options, Vector3& psi) {
  LevenbergMarquardtDamping damping(options.initial_damping);
  double cost = point_cost(model, kernel, views, psi);
  PointEquations equations = point_equations(model, kernel, views, psi);
  for (int n = 0; n < options.max_iterations && cost > 0; ++n) {
    const Vector3 D = damping_diagonal(equations.H);
    Matrix3 damped = equations.H;
    damped.diagonal() += damping.lambda() * D;
    const Eigen::LLT<Matrix3> llt(damped);
    if (llt.info() != Eigen::Success) return;
    const Vector3 step = llt.solve(-equations.g);
    const double predicted = -equations.g.dot(step) + damping.lambda() * step.dot(D.cwiseProduct(step));
    if (!(predicted > 0)) return;

    Vector3 moved = psi + step;
    moved.z() = std::max(moved.z(), kMinInverseDepth);
    const double new_cost = point_cost(model, kernel, views, moved);
    if (!(new_cost < cost)) {
      damping.reject();
      continue;
    }
    const double decrease = cost - new_cost;
    psi = moved;
    cost = new_cost;
    if (decrease < options.relative_decrease * cost) return;
    damping.accept(decrease / predicted);
    equations = point_equations(model, kernel, views, psi);
  }
}

}  // namespace

void optimise_structure(WindowProblem& problem, const WindowSolverOptions& options) {
  const ObservationModel model(problem.rig);
  const HuberKernel kernel{options.huber_sigmas};
  std::vector<PointView> views;
  for (auto& point : problem.points) {
    if (!(point.psi.z() > 0)) continue;
    collect_views(problem, point, model, views);
    if (!views.empty()) optimise_point(model, kernel, views, options, point.psi);
  }
}

}  // namespace twofold
