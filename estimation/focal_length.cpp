#include "estimation/focal_length.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "estimation/observation_model.hpp"
#include "estimation/reduced_system.hpp"
#include "estimation/window_solver.hpp"
#include "geometry/inverse_depth.hpp"
#include "geometry/so3.hpp"

namespace twofold {
namespace {

using Matrix23 = Eigen::Matrix<double, 2, 3>;

constexpr int kMaxFocalSteps = 6;
/// Of the poses' diagonal: leaves the unit of length free, and is far below what bends a long way.
constexpr double kGaugeDamping = 1e-10;
/// A step of the scale beyond this is none that a linearisation may be believed in.
constexpr double kMaxFocalStep = 0.2;

/// One observation, linearised; by_focal is by the logarithm of the focal length.
struct LensTerms {
  Vector3 x;  ///< of the point in the observing camera
  Matrix23 by_x, by_psi;
  Vector2 by_focal, error, weight;

  LensTerms(const ObservationModel& model, const HuberKernel& kernel, const RigidMotion& T_i_a,
            const Vector3& psi, const WindowLayout::Observation& o) {
    const Vector3 Ry = T_i_a.R * from_inverse_depth(psi);
    x = Ry + T_i_a.t;
    const double inv_z = 1 / x.z();
    by_focal = {model.fx * x.x() * inv_z, model.fy * x.y() * inv_z};
    error = by_focal + Vector2(model.cx - o.pixel.x(), model.cy - o.pixel.y());
    by_x << model.fx * inv_z, 0, -by_focal.x() * inv_z, 0, model.fy * inv_z, -by_focal.y() * inv_z;
    Matrix3 x_by_psi;
    x_by_psi << T_i_a.R.leftCols<2>(), -Ry;
    by_psi = by_x * x_by_psi / psi.z();
    const Vector2 information = o.information.head<2>().cast<double>();
    weight = information * kernel.weight(error.dot(information.cwiseProduct(error)));
  }
  /// By the motion of the observing camera against the anchor (WindowLayout).
  [[nodiscard]] Eigen::Matrix<double, 2, 6> by_motion() const {
    Eigen::Matrix<double, 2, 6> J;
    J << by_x, -by_x * hat(x);
    return J;
  }
};

/// The focal length's row of the normal equations, points eliminated: couplings with the poses, by position,
/// its own diagonal entry, and its gradient.
struct FocalRow {
  std::vector<Vector6> coupling;
  double diagonal = 0, gradient = 0;

  /// What changes with the focal length but cannot be taken up by the point.
  void add_track(const WindowLayout& layout, const WindowLayout::Group& group,
                 const WindowLayout::Track& track, const ObservationModel& model, const HuberKernel& kernel,
                 const WindowState& state, const Vector3& psi) {
    const WindowLayout::Observation* first = &layout.observations()[track.first_observation];
    Matrix3 V = Matrix3::Zero();
    Vector3 v = Vector3::Zero();
    const auto terms_of = [&](int n) {
      return LensTerms(model, kernel, state.relative[group.first_slot + first[n].slot], psi, first[n]);
    };
    for (int n = 0; n < track.observation_count; ++n) {
      const LensTerms terms = terms_of(n);
      V += terms.by_psi.transpose() * terms.weight.asDiagonal() * terms.by_psi;
      v += terms.by_psi.transpose() * terms.weight.cwiseProduct(terms.by_focal);
    }
    V.diagonal() += kGaugeDamping * damping_diagonal(V);
    const Vector3 taken_up = V.ldlt().solve(v);
    for (int n = 0; n < track.observation_count; ++n) {
      const LensTerms terms = terms_of(n);
      const Vector2 force = terms.weight.cwiseProduct(terms.by_focal - terms.by_psi * taken_up);
      diagonal += force.dot(terms.by_focal);
      gradient += force.dot(terms.error);
      const int slot = group.first_slot + first[n].slot;
      const Vector6 on_motion = terms.by_motion().transpose() * force;
      if (const int p = layout.slots()[slot].position; p >= 0) coupling[p] += on_motion;
      if (group.anchor_position >= 0)
        coupling[group.anchor_position] -= adjoint_transposed(state.relative[slot]) * on_motion;
    }
  }
};

struct FocalStep {
  double log_scale = 0, sigma = 0;
};

/// Of a solved problem, whose poses and points have no gradient left.
std::optional<FocalStep> focal_step(const WindowProblem& problem, const WindowSolverOptions& options) {
  ReducedSystem system;
  const WindowState state = system.start(problem);
  const WindowLayout& layout = system.layout();
  system.build(problem, options, state, kGaugeDamping);
  if (layout.tracks().empty() || !system.factorise()) return std::nullopt;
  FocalRow row;
  row.coupling.assign(system.factor().size(), Vector6::Zero());
  const ObservationModel model(problem.rig);
  const HuberKernel kernel{options.huber_sigmas};
  for (const WindowLayout::Group& group : layout.groups()) {
    for (int k = group.first_track; k < group.first_track + group.track_count; ++k)
      row.add_track(layout, group, layout.tracks()[k], model, kernel, state, state.psi[k]);
  }
  std::vector<Vector6> taken_up = row.coupling;
  system.factor().solve(taken_up);
  double information = row.diagonal;
  for (std::size_t p = 0; p < taken_up.size(); ++p) information -= row.coupling[p].dot(taken_up[p]);
  if (!(information > 0)) return std::nullopt;
  const double freedom = 2.0 * static_cast<double>(layout.observations().size()) -
                         3.0 * static_cast<double>(layout.tracks().size()) - 6.0 * system.factor().size();
  if (!(freedom > 0)) return std::nullopt;
  const double variance = window_cost(problem, options) / freedom;  // of a whitened measurement
  return FocalStep{-row.gradient / information, std::sqrt(variance / information)};
}

/// Points stay where their anchors see them.
void scale_focal_length(double scale, WindowProblem& problem) {
  problem.rig.camera.fx *= scale;
  problem.rig.camera.fy *= scale;
  for (WindowProblem::Point& point : problem.points) point.psi.head<2>() /= scale;
}

}  // namespace

std::optional<FocalLengthEstimate> estimate_focal_length(WindowProblem& problem,
                                                         const WindowSolverOptions& options, double enough) {
  WindowSolver solver;
  double scale = 1;
  for (int n = 0; n < kMaxFocalSteps; ++n) {
    const auto step = focal_step(problem, options);
    if (!step || std::abs(step->log_scale) > kMaxFocalStep) return std::nullopt;
    const double next = scale * std::exp(step->log_scale);
    const bool settled = n == 0 ? std::abs(next - 1) < enough : std::abs(step->log_scale) < 0.1 * enough;
    if (settled || step->sigma > enough) return FocalLengthEstimate{next, next * step->sigma};
    scale_focal_length(next / scale, problem);
    scale = next;
    solver.solve(problem, options);
  }
  return std::nullopt;
}

}  // namespace twofold
