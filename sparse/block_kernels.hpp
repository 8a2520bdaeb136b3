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

/// One outer product of six rows and six columns, added to A in registers.
///
/// Six rows do not fill registers of four. But two columns of six are three registers without a gap: rows 0-3
/// of the even column, its rows 4-5 with rows 0-1 of the odd column, rows 2-5 of the odd column. Nine
/// registers hold all of A; Eigen's product of this size works in halves of a register.
template <int kSign>
[[gnu::always_inline]] inline void accumulate_outer_product(Packet4 (&acc)[9], const double* b,
                                                            const double* c) {
  static_assert(kSign == 1 || kSign == -1);
  const Packet4 b0123 = load4(b);
  const Packet4 b2345 = load4(b + 2);
  const Packet4 b4501 = __builtin_shufflevector(b2345, b0123, 2, 3, 4, 5);
#pragma GCC unroll 3
  for (int pair = 0; pair < 3; ++pair) {
    const Packet4 c_even = broadcast4(c + 2 * pair);
    const Packet4 c_odd = broadcast4(c + 2 * pair + 1);
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

/// All of a 6x6 block, column-major and dense, in the nine registers, and back.
inline void load_block(Packet4 (&acc)[9], const double* a) {
#pragma GCC unroll 9
  for (int n = 0; n < 9; ++n) acc[n] = load4(a + 4 * n);
}
inline void store_block(const Packet4 (&acc)[9], double* a) {
#pragma GCC unroll 9
  for (int n = 0; n < 9; ++n) store4(a + 4 * n, acc[n]);
}
template <int kSign, int K>
[[gnu::always_inline]] inline void accumulate_outer_products(Packet4 (&acc)[9], const double* b,
                                                             const double* c) {
#pragma GCC unroll 6
  for (int k = 0; k < K; ++k) accumulate_outer_product<kSign>(acc, b + 6 * k, c + 6 * k);
}

/// A += sign * B C^T with A 6x6, B and C 6xK, all column-major and dense.
///
/// No __restrict, as C is all read before A is written: with it, a loop over B and A has the numbers of C
/// broadcast ahead of it, to the stack, and waits for loads.
template <int kSign, int K>
inline void add_outer_product(double* a, const double* b, const double* c) {
  Packet4 acc[9];
  load_block(acc, a);
  accumulate_outer_products<kSign, K>(acc, b, c);
  store_block(acc, a);
}

/// How many numbers behind the last strip subtract_strip_product may read (and not use).
inline constexpr int kStripOverrun = 3;

/// A -= B C^T with A NxN, B and C NxK, K even for N = 6, all column-major and dense.
///
/// The same with K at run time, and for other N: there a column of A has registers of its own, not all of
/// them full.
template <int N>
inline void subtract_strip_product(double* a, const double* b, const double* c, int K) {
  if constexpr (N == 6) {
    Packet4 acc[9];
    load_block(acc, a);
    for (int k = 0; k < K; k += 2) accumulate_outer_products<-1, 2>(acc, b + 6 * k, c + 6 * k);
    store_block(acc, a);
  } else {
    constexpr int kPackets = (N + 3) / 4;
    constexpr int kChains = N <= 3 ? 2 : 1;  // a single short one would wait for its own sums
    Packet4 acc[kChains][N][kPackets] = {};
    const auto add_column = [&](Packet4(&sum)[N][kPackets], int k) {
#pragma GCC unroll 7
      for (int j = 0; j < N; ++j) {
        const Packet4 c_jk = broadcast4(c + N * k + j);
#pragma GCC unroll 2
        for (int p = 0; p < kPackets; ++p) sum[j][p] += load4(b + N * k + 4 * p) * c_jk;
      }
    };
    int k = 0;
    for (; k + kChains <= K; k += kChains) {
#pragma GCC unroll 2
      for (int chain = 0; chain < kChains; ++chain) add_column(acc[chain], k + chain);
    }
    if (k < K) add_column(acc[0], k);
    for (int j = 0; j < N; ++j) {
      double column[4 * kPackets];
      for (int p = 0; p < kPackets; ++p) {
        store4(column + 4 * p, kChains == 2 ? acc[0][j][p] + acc[kChains - 1][j][p] : acc[0][j][p]);
      }
      for (int i = 0; i < N; ++i) a[N * j + i] -= column[i];
    }
  }
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
