#include "estimation/covariance.hpp"

#include <Eigen/LU>

#include "base/check.hpp"

namespace twofold {

std::optional<WindowCovariance> WindowCovariance::compute(const WindowProblem& problem,
                                                          const WindowSolverOptions& options) {
  TWOFOLD_CHECK(invalid_reason(problem).empty(), "window problem");
  WindowCovariance result;
  WindowState state = result.system_.start(problem);
  // Without damping a free gauge leaves pivots made of rounding, of either sign. This much damping changes a
  // covariance by a share of 1e-12 and shows an undetermined direction as a pivot no larger than itself.
  constexpr double kDamping = 1e-12;
  result.system_.build(problem, options, state, kDamping);
  if (!result.system_.factorise() || result.system_.smallest_pivot_ratio() < 1e3 * kDamping) {
    return std::nullopt;
  }
  result.relative_ = std::move(state.relative);
  for (const auto& pose : problem.poses) result.fixed_.push_back(pose.fixed ? 1 : 0);
  const WindowLayout& layout = result.system_.layout();
  result.track_of_point_.assign(problem.points.size(), -1);
  result.group_of_track_.resize(layout.tracks().size());
  for (std::size_t g = 0; g < layout.groups().size(); ++g) {
    const auto& group = layout.groups()[g];
    for (int t = group.first_track; t < group.first_track + group.track_count; ++t) {
      result.track_of_point_[layout.tracks()[t].point] = t;
      result.group_of_track_[t] = static_cast<int>(g);
    }
  }
  return result;
}

std::optional<Matrix6> WindowCovariance::poses(int i, int j) const {
  const auto known = [this](int k) { return fixed_[k] != 0 || system_.layout().position(k) >= 0; };
  if (!known(i) || !known(j)) return std::nullopt;
  const int row = system_.layout().position(i), column = system_.layout().position(j);
  if (row < 0 || column < 0) return Matrix6::Zero();
  Matrix6 block;
  std::vector<Vector6> x(system_.factor().size());
  for (int c = 0; c < 6; ++c) {
    std::fill(x.begin(), x.end(), Vector6::Zero());
    x[column][c] = 1;
    system_.factor().solve(x);
    block.col(c) = x[row];
  }
  return block;
}

/// With G = sum Y_i^T d xi_i / d delta, the point's block of the inverse is L^-T (I + G S^-1 G^T) L^-1.
std::optional<Matrix3> WindowCovariance::point(int k) const {
  const int t = track_of_point_[k];
  if (t < 0) return std::nullopt;
  const WindowLayout& layout = system_.layout();
  const auto& track = layout.tracks()[t];
  const auto& group = layout.groups()[group_of_track_[t]];
  const BlockCholesky& factor = system_.factor();
  std::vector<Vector6> columns[3];
  for (auto& column : columns) column.assign(factor.size(), Vector6::Zero());
  for (int n = track.first_entry; n < track.first_entry + track.entry_count; ++n) {
    const int s = group.first_slot + layout.entry_slots()[n];
    const auto& Y = system_.elimination().couplings()[n];
    const int position = layout.slots()[s].position;
    for (int c = 0; c < 3; ++c) {
      if (position >= 0) columns[c][position] += Y.col(c);
      if (group.anchor_position >= 0) {
        const Matrix6 adjoint = SE3(relative_[s].R, relative_[s].t).adjoint();
        columns[c][group.anchor_position] -= adjoint.transpose() * Y.col(c);
      }
    }
  }
  for (auto& column : columns) factor.solve_lower(column);
  Matrix3 M = Matrix3::Identity();
  for (int p = 0; p < factor.size(); ++p) {
    for (int row = 0; row < 3; ++row) {
      for (int col = 0; col < 3; ++col) M(row, col) += columns[row][p].dot(columns[col][p]);
    }
  }
  const Matrix3 L_inverse = system_.elimination().points()[t].L.inverse();
  return L_inverse.transpose() * M * L_inverse;
}

}  // namespace twofold
