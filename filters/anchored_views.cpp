#include "filters/anchored_views.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "estimation/levenberg_marquardt.hpp"
#include "filters/batched_views.hpp"

namespace twofold {
namespace {

constexpr int kMaxAttempts = 8;  // dampings tried for one step
constexpr double kImpossible = std::numeric_limits<double>::infinity();

}  // namespace

double AnchoredViews::cost() const {
  const BatchedViews batched(*this);
  return batched.cost(batched.start());
}

std::vector<double> AnchoredViews::worst_errors() const {
  const BatchedViews batched(*this);
  return batched.worst_errors(batched.start());
}

bool AnchoredViews::minimise(int max_iterations, double min_gain) {
  BatchedViews batched(*this);
  AnchoredState state = batched.start(), trial = state;
  double current = batched.cost(state), damping = 1e-6;
  if (!std::isfinite(current)) return false;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    double next = kImpossible;
    int attempt = 0;
    for (; attempt < kMaxAttempts; ++attempt) {
      batched.linearise(state);
      if (batched.step(damping, state, trial)) next = batched.cost(trial);
      if (next <= current) break;
      damping = raised_damping(damping, 1e-4);
    }
    if (!(next <= current)) break;
    std::swap(state, trial);
    const double gain = current - next;
    current = next;
    if (attempt == 0) damping = std::max(0.1 * damping, 1e-12);  // less of it has only just failed otherwise
    if (gain < min_gain) break;
  }
  batched.write(state, *this);
  return true;
}

bool AnchoredViews::normalise_scale() {
  const double length = views.front().T_c_a.translation().norm();
  if (!(length > 1e-9)) return false;
  for (View& view : views) view.T_c_a.translation() /= length;
  for (Point& point : points) point.psi.z() *= length;
  return true;
}

Eigen::MatrixXd AnchoredViews::information() const {
  BatchedViews batched(*this);
  if (!std::isfinite(batched.cost(batched.start()))) return {};
  batched.linearise(batched.start());
  return batched.information();
}

}  // namespace twofold
