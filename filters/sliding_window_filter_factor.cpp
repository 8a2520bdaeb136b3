#include "filters/sliding_window_filter_factor.hpp"

#include "base/check.hpp"

namespace twofold {
namespace {

double cubed(double x) {
  return x * x * x;
}

}  // namespace

bool FilterFactor::factorise(const FilterEquations& eq, double damping, Order order) {
  m_ = eq.pose_count();
  n_ = eq.landmark_count();
  n_prior_ = eq.prior_landmarks;
  has_motion_ = eq.has_motion;
  if (order == Order::kCheaper) {
    const double tracks = static_cast<double>(eq.couplings.size());
    const double length = n_ > 0 ? tracks / n_ : 0.0;
    const double map_onto_path = cubed(6.0 * m_ + 3.0 * n_prior_) / 3 + 108.0 * tracks * length;
    const double path_onto_map = 6.0 * m_ * 9.0 * n_ * static_cast<double>(n_) + cubed(3.0 * n_) / 3;
    order = map_onto_path <= path_onto_map ? Order::kMapOntoPath : Order::kPathOntoMap;
  }
  order_ = order;
  return order == Order::kMapOntoPath ? factorise_map_onto_path(eq, damping)
                                      : factorise_path_onto_map(eq, damping);
}

void FilterFactor::solve(const std::vector<Vector6>& gp, const std::vector<Vector3>& gm,
                         FilterStep& step) const {
  TWOFOLD_CHECK(order_ != Order::kCheaper, "factorise() first");
  if (order_ == Order::kMapOntoPath) {
    solve_map_onto_path(gp, gm, step);
  } else {
    solve_path_onto_map(gp, gm, step);
  }
}

FilterCovariances FilterFactor::covariances() const {
  TWOFOLD_CHECK(order_ != Order::kCheaper, "factorise() first");
  return order_ == Order::kMapOntoPath ? covariances_map_onto_path() : covariances_path_onto_map();
}

}  // namespace twofold
