#include "geometry/real_roots.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.hpp"

namespace twofold {
namespace {

constexpr int kMaxDegree = 16;
using Polynomial = std::array<double, kMaxDegree + 1>;  // that of z^i at i
using Roots = std::array<double, kMaxDegree>;

struct Value {
  double p, slope;
};

Value evaluate(const Polynomial& c, int degree, double z) {
  Value v{c[static_cast<std::size_t>(degree)], 0};
  for (int i = degree - 1; i >= 0; --i) {
    v.slope = v.slope * z + v.p;
    v.p = v.p * z + c[static_cast<std::size_t>(i)];
  }
  return v;
}

/// The root between `low` and `high`, where the polynomial has different signs.
double root_between(const Polynomial& c, int degree, double low, double high) {
  constexpr int kMaxSteps = 100;  // sixty halvings are all that doubles can tell apart
  const bool rising = evaluate(c, degree, low).p < 0;
  double z = 0.5 * (low + high);
  for (int i = 0; i < kMaxSteps; ++i) {
    const Value v = evaluate(c, degree, z);
    if (v.p == 0) return z;
    ((v.p < 0) == rising ? low : high) = z;
    double next = z - v.p / v.slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - z) <= 1e-16 || next == low || next == high) return next;
    z = next;
  }
  return z;
}

/// Roots in [-1, 1], ascending.
int roots_in_unit_interval(const Polynomial& c, int degree, Roots& roots) {
  int count = 0;
  Polynomial derivative{};
  for (int d = 1; d <= degree; ++d) {
    // The derivative of degree d over (n - d)!: binomials instead of factorials.
    const int times = degree - d;
    double binomial = 1;
    for (int i = 0; i <= d; ++i) {
      derivative[static_cast<std::size_t>(i)] = binomial * c[static_cast<std::size_t>(i + times)];
      binomial = binomial * (i + 1 + times) / (i + 1);
    }
    Roots found;
    int next = 0;
    double low = -1;
    for (int k = 0; k <= count; ++k) {
      const double high = k < count ? roots[static_cast<std::size_t>(k)] : 1;
      const bool below = evaluate(derivative, d, low).p < 0;
      if (below != (evaluate(derivative, d, high).p < 0))
        found[static_cast<std::size_t>(next++)] = root_between(derivative, d, low, high);
      low = high;
    }
    roots = found;
    count = next;
  }
  return count;
}

}  // namespace

int real_roots(std::span<const double> coefficients, std::span<double> roots) {
  TWOFOLD_CHECK(!coefficients.empty() && coefficients.size() <= kMaxDegree + 1, "degree");
  TWOFOLD_CHECK(roots.size() + 1 >= coefficients.size(), "room for all roots");
  double largest = 0;
  for (const double c : coefficients) {
    if (!std::isfinite(c)) return 0;
    largest = std::max(largest, std::abs(c));
  }
  const int degree = static_cast<int>(coefficients.size()) - 1;
  Polynomial scaled{}, reversed{};
  for (int i = 0; i <= degree; ++i) {
    scaled[static_cast<std::size_t>(i)] = coefficients[static_cast<std::size_t>(i)] / largest;
    reversed[static_cast<std::size_t>(degree - i)] = scaled[static_cast<std::size_t>(i)];
  }
  if (largest == 0) return 0;
  Roots inside;
  int count = 0;
  const int within = roots_in_unit_interval(scaled, degree, inside);
  for (int k = 0; k < within; ++k)
    roots[static_cast<std::size_t>(count++)] = inside[static_cast<std::size_t>(k)];
  const int beyond = roots_in_unit_interval(reversed, degree, inside);
  for (int k = 0; k < beyond; ++k) {
    const double w = inside[static_cast<std::size_t>(k)];
    if (std::abs(w) < 1 && w != 0) roots[static_cast<std::size_t>(count++)] = 1 / w;
  }
  return count;
}

}  // namespace twofold
