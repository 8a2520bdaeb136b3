#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstring>

namespace twofold {

/// Four doubles that the compiler maps to one AVX register, or to two SSE2 ones.
using Packet4 = double __attribute__((vector_size(32)));

[[nodiscard]] inline Packet4 load4(const double* p) {
  Packet4 value;
  std::memcpy(&value, p, sizeof value);
  return value;
}
/// *p in all four places. The compiler must not see through it: out of two such vectors it would make a third
/// by shuffles of the numbers, and shuffles have fewer units than loads and blends.
[[nodiscard]] inline Packet4 broadcast4(const double* p) {
  Packet4 value = {*p, *p, *p, *p};
#ifdef __AVX__
  asm("" : "+x"(value));
#endif
  return value;
}
inline void store4(double* p, const Packet4& value) {
  std::memcpy(p, &value, sizeof value);
}

/// A += sign * B C^T with A 6x6, B and C 6xK, all column-major and dense.
///
/// Six rows do not fill registers of four. But two columns of six are three registers without a gap: rows 0-3
/// of the even column, its rows 4-5 with rows 0-1 of the odd column, rows 2-5 of the odd column. Nine
/// registers hold all of A while the K outer products are added; Eigen's product of this size works in halves
/// of a register.
///
/// No __restrict, as C is all read before A is written: with it, a loop over B and A has the numbers of C
/// broadcast ahead of it, to the stack, and waits for loads.
template <int kSign, int K>
inline void add_outer_product(double* a, const double* b, const double* c) {
  static_assert(kSign == 1 || kSign == -1);
  Packet4 acc[9];
#pragma GCC unroll 9
  for (int n = 0; n < 9; ++n) acc[n] = load4(a + 4 * n);
#pragma GCC unroll 6
  for (int k = 0; k < K; ++k) {
    const double* bk = b + 6 * k;
    const double* ck = c + 6 * k;
    const Packet4 b0123 = load4(bk);
    const Packet4 b2345 = load4(bk + 2);
    const Packet4 b4501 = __builtin_shufflevector(b2345, b0123, 2, 3, 4, 5);
#pragma GCC unroll 3
    for (int pair = 0; pair < 3; ++pair) {
      const Packet4 c_even = broadcast4(ck + 2 * pair);
      const Packet4 c_odd = broadcast4(ck + 2 * pair + 1);
      const Packet4 c_both = __builtin_shufflevector(c_even, c_odd, 0, 1, 6, 7);
      if constexpr (kSign > 0) {
        acc[3 * pair] += b0123 * c_even;
        acc[3 * pair + 1] += b4501 * c_both;
        acc[3 * pair + 2] += b2345 * c_odd;
      } else {
        acc[3 * pair] -= b0123 * c_even;
        acc[3 * pair + 1] -= b4501 * c_both;
        acc[3 * pair + 2] -= b2345 * c_odd;
      }
    }
  }
#pragma GCC unroll 9
  for (int n = 0; n < 9; ++n) store4(a + 4 * n, acc[n]);
}

/// Sets n matrices standing one after the other to zero, as one piece of memory: element by element the
/// compiler does far worse.
template <class Matrix>
inline void set_all_zero(Matrix* first, std::size_t n) {
  if (n > 0) std::memset(static_cast<void*>(first), 0, n * sizeof(Matrix));
}

/// Lower Cholesky factor of A in place, read below the diagonal, and its inverse; false when a pivot is not
/// positive (to rounding).
template <int N>
inline bool factorise_diagonal(Eigen::Matrix<double, N, N>& A, Eigen::Matrix<double, N, N>& inverse) {
  for (int j = 0; j < N; ++j) {
    double pivot = A(j, j);
    for (int k = 0; k < j; ++k) pivot -= A(j, k) * A(j, k);
    if (!(pivot > 1e-15 * std::abs(A(j, j))) || !std::isfinite(pivot)) return false;
    const double root = std::sqrt(pivot);
    const double inv_root = 1 / root;
    A(j, j) = root;
    for (int i = j + 1; i < N; ++i) {
      double value = A(i, j);
      for (int k = 0; k < j; ++k) value -= A(i, k) * A(j, k);
      A(i, j) = value * inv_root;
      A(j, i) = 0;
    }
    inverse(j, j) = inv_root;
  }
  for (int j = 0; j < N; ++j) {
    for (int i = 0; i < j; ++i) inverse(i, j) = 0;
    for (int i = j + 1; i < N; ++i) {
      double value = 0;
      for (int k = j; k < i; ++k) value -= A(i, k) * inverse(k, j);
      inverse(i, j) = value * inverse(i, i);
    }
  }
  return true;
}

}  // namespace twofold
