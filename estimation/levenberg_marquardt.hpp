#pragma once

#include <algorithm>

namespace twofold {

/// Damping of Levenberg-Marquardt after Nielsen: shrinks smoothly with the gain ratio of an accepted step,
/// grows ever faster over rejected ones.
class LevenbergMarquardtDamping {
 public:
  /// @param lambda  start value, relative to the diagonal of the normal equations, > 0
  explicit LevenbergMarquardtDamping(double lambda) : lambda_(std::clamp(lambda, kSmallest, kLargest)) {}

  [[nodiscard]] double lambda() const { return lambda_; }
  /// @param gain  decrease of the cost over the decrease the quadratic model promised, > 0
  void accept(double gain) {
    const double s = 2 * gain - 1;
    lambda_ = std::max(kSmallest, lambda_ * std::clamp(1 - s * s * s, 1.0 / 3, 2.0));
    growth_ = 2;
  }
  void reject() {
    lambda_ = std::min(kLargest, lambda_ * growth_);
    growth_ = std::min(growth_ * 2, kLargest);
  }
  /// So strongly damped that steps no longer move anything.
  [[nodiscard]] bool exhausted() const { return lambda_ >= kLargest; }

 private:
  // Below the smallest value the gauge directions of a free window would drown in rounding.
  static constexpr double kSmallest = 1e-10;
  static constexpr double kLargest = 1e12;
  double lambda_;
  double growth_ = 2;
};

/// Plain damping after a step that failed: ten times as much, at least `first`, as it may have been 0 so far.
[[nodiscard]] inline double raised_damping(double damping, double first) {
  return std::max(10 * damping, first);
}

}  // namespace twofold
