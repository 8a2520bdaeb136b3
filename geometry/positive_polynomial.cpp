#include "geometry/positive_polynomial.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMostCoefficients = 9;
constexpr int kMostHalvings = 30;
using Bernstein = std::array<double, kMostCoefficients>;

/// Their sum over i of C(n, i) (1 - t)^(n - i) t^i, t = z / end, is the polynomial.
Bernstein bernstein(std::span<const double> c, double end) {
  const std::size_t degree = c.size() - 1;
  Bernstein b{};
  double factor = 1;  // end^i / C(n, i)
  for (std::size_t i = 0; i <= degree; ++i) {
    b[i] = factor * c[i];
    factor *= end * static_cast<double>(i + 1) / static_cast<double>(std::max<std::size_t>(degree - i, 1));
  }
  // b_i = sum over j <= i of C(i, j) c_j end^j / C(n, j), as Pascal's triangle adds up.
  for (std::size_t k = 0; k < degree; ++k) {
    for (std::size_t i = degree; i > k; --i) b[i] += b[i - 1];
  }
  return b;
}

bool is_positive(Bernstein& b, std::size_t degree, int halvings) {
  if (!(b[0] > 0 && b[degree] > 0)) return false;
  if (std::all_of(b.begin(), b.begin() + static_cast<std::ptrdiff_t>(degree) + 1,
                  [](double x) { return x > 0; })) {
    return true;
  }
  if (halvings == 0) return false;
  Bernstein lower;  // half; b becomes the upper one (de Casteljau)
  for (std::size_t i = 0; i <= degree; ++i) {
    lower[i] = b[0];
    for (std::size_t j = 0; j + i < degree; ++j) b[j] = 0.5 * (b[j] + b[j + 1]);
  }
  return is_positive(lower, degree, halvings - 1) && is_positive(b, degree, halvings - 1);
}

}  // namespace

bool is_positive_to(double end, std::span<const double> coefficients) {
  TWOFOLD_CHECK(!coefficients.empty() && coefficients.size() <= kMostCoefficients, "degree");
  Bernstein b = bernstein(coefficients, end);
  if (!std::all_of(b.begin(), b.end(), [](double x) { return std::isfinite(x); })) return false;
  return is_positive(b, coefficients.size() - 1, kMostHalvings);
}

}  // namespace twofold
