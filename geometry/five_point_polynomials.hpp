#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/types.hpp"

namespace twofold::five_point {

/// Polynomials in (x, y, z) as coefficient rows. Monomials, highest degree first:
///   cubic      x3 x2y x2z xy2 xyz xz2 y3 y2z yz2 z3, then those of
///   quadratic  x2 xy xz y2 yz z2, then those of
///   linear     x y z 1
using Linear = Eigen::Matrix<double, 1, 4>;
using Quadratic = Eigen::Matrix<double, 1, 10>;
using Cubic = Eigen::Matrix<double, 1, 20>;

struct Exponents {
  int x, y, z;
  constexpr bool operator==(const Exponents&) const = default;
};

inline constexpr std::array<Exponents, 20> kMonomials{
    {{3, 0, 0}, {2, 1, 0}, {2, 0, 1}, {1, 2, 0}, {1, 1, 1}, {1, 0, 2}, {0, 3, 0},
     {0, 2, 1}, {0, 1, 2}, {0, 0, 3}, {2, 0, 0}, {1, 1, 0}, {1, 0, 1}, {0, 2, 0},
     {0, 1, 1}, {0, 0, 2}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}};

/// kProduct[i][j]: position of monomial i times monomial j among the twenty; -1 above degree three.
inline constexpr auto kProduct = [] {
  std::array<std::array<int, 20>, 20> table{};
  for (int i = 0; i < 20; ++i) {
    for (int j = 0; j < 20; ++j) {
      table[i][j] = -1;
      const Exponents sum{kMonomials[i].x + kMonomials[j].x, kMonomials[i].y + kMonomials[j].y,
                          kMonomials[i].z + kMonomials[j].z};
      for (int k = 0; k < 20; ++k) {
        if (kMonomials[k] == sum) table[i][j] = k;
      }
    }
  }
  return table;
}();

/// Products of polynomials. Functions of their own: unrolled into every sum of them, the ten constraints take
/// a compiler most of a minute.
[[nodiscard, gnu::noinline]] inline Quadratic product(const Linear& p, const Linear& q) {
  Quadratic r = Quadratic::Zero();
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) r[kProduct[16 + i][16 + j] - 10] += p[i] * q[j];
  }
  return r;
}

[[nodiscard, gnu::noinline]] inline Cubic product(const Quadratic& p, const Linear& q) {
  Cubic r = Cubic::Zero();
  for (int i = 0; i < 10; ++i) {
    for (int j = 0; j < 4; ++j) r[kProduct[10 + i][16 + j]] += p[i] * q[j];
  }
  return r;
}

/// The monomials at (x, y, z), and their derivatives by x, y and z.
inline void evaluate(const Vector3& at, Eigen::Matrix<double, 20, 1>& monomials,
                     Eigen::Matrix<double, 20, 3>& derivatives) {
  double power[3][5];  // x^(i - 1) at i; 0 stands where only a factor of 0 follows
  for (int c = 0; c < 3; ++c) {
    power[c][0] = 0;
    power[c][1] = 1;
    for (int i = 2; i < 5; ++i) power[c][i] = power[c][i - 1] * at[c];
  }
  for (int k = 0; k < 20; ++k) {
    const auto [i, j, l] = kMonomials[static_cast<std::size_t>(k)];
    const double x = power[0][i + 1], y = power[1][j + 1], z = power[2][l + 1];
    monomials[k] = x * y * z;
    derivatives.row(k) << i * power[0][i] * y * z, j * x * power[1][j] * z, l * x * y * power[2][l];
  }
}

}  // namespace twofold::five_point
