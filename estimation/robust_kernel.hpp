#pragma once

#include <cmath>

namespace twofold {

/// Huber's kernel on a whitened residual norm r = sqrt(chi2): rho = r^2 inside delta, 2 delta r - delta^2
/// outside. (thesis 3.3.7; SWF 3). delta <= 0 or infinite switches it off.
struct HuberKernel {
  double delta = 0;

  [[nodiscard]] double rho(double chi2) const {
    if (!(delta > 0) || chi2 <= delta * delta) return chi2;
    return 2 * delta * std::sqrt(chi2) - delta * delta;
  }
  /// d rho / d chi2: weight of the residual in iteratively re-weighted least squares, in (0, 1].
  [[nodiscard]] double weight(double chi2) const {
    if (!(delta > 0) || chi2 <= delta * delta) return 1.0;
    return delta / std::sqrt(chi2);
  }

  // The same of the norms r of several residuals side by side, in an Eigen array, without branches: with
  // c = min(r, delta), rho = c (2 r - c) and the weight is delta / max(r, delta). 0 < delta, finite.
  template <class Norms>
  [[nodiscard, gnu::always_inline]] Norms rho_of_norms(const Norms& r) const {
    const Norms clipped = r.min(delta);
    return clipped * (2 * r - clipped);
  }
  template <class Norms>
  [[nodiscard, gnu::always_inline]] Norms weights_of_norms(const Norms& r) const {
    return delta / r.max(delta);
  }
};

}  // namespace twofold
