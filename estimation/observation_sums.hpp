#pragma once

#include "estimation/observation_model.hpp"
#include "sparse/block_kernels.hpp"

namespace twofold {

/// Three rows of a matrix with up to four columns, each in a register; what stands beyond the last column has
/// no meaning.
struct Rows3 {
  Packet4 row[3] = {};

  Rows3& operator+=(const Rows3& other) {
    for (int r = 0; r < 3; ++r) row[r] += other.row[r];
    return *this;
  }
};

/// [x]x M
[[nodiscard]] inline Rows3 cross(const Vector3& x, const Rows3& M) {
  return {{x.y() * M.row[2] - x.z() * M.row[1], x.z() * M.row[0] - x.x() * M.row[2],
           x.x() * M.row[1] - x.y() * M.row[0]}};
}

/// x cross v, in the first three numbers.
[[nodiscard]] inline Packet4 cross(const Packet4& x, const Packet4& v) {
  const Packet4 product =
      x * __builtin_shufflevector(v, v, 1, 2, 0, 3) - v * __builtin_shufflevector(x, x, 1, 2, 0, 3);
  return __builtin_shufflevector(product, product, 1, 2, 0, 3);
}

/// S M for the S of an observation.
[[nodiscard]] inline Rows3 apply(const ObservationTerms& s, const Rows3& M) {
  return {{s.s00 * M.row[0] + s.s02 * M.row[2], s.s11 * M.row[1] + s.s12 * M.row[2],
           s.s02 * M.row[0] + s.s12 * M.row[1] + s.s22 * M.row[2]}};
}

/// R^T M
[[nodiscard]] inline Rows3 transposed_times(const Matrix3& R, const Rows3& M) {
  Rows3 result;
  for (int r = 0; r < 3; ++r) {
    result.row[r] = R(0, r) * M.row[0] + R(1, r) * M.row[1] + R(2, r) * M.row[2];
  }
  return result;
}

/// The six rows of A^T W B: coupling of a pose with a point.
struct CouplingRows {
  Rows3 translation, rotation;

  CouplingRows& operator+=(const CouplingRows& other) {
    translation += other.translation;
    rotation += other.rotation;
    return *this;
  }
};

/// A^T W A and A^T W e of one slot over its observations. With A = J_x [I, -[x]x], S = J_x^T W J_x and
/// X = [x]x they are [S, -S X; X S, -X S X] and (f, x cross f).
class ObservationSums {
 public:
  void add(const ObservationTerms& s, const Vector3& x) {
    const Rows3 S{{{s.s00, 0, s.s02, 0}, {0, s.s11, s.s12, 0}, {s.s02, s.s12, s.s22, 0}}};
    const Rows3 XS = cross(x, S);
    const Packet4 x4 = {x.x(), x.y(), x.z(), 0};
    const Packet4 f4 = {s.force.x(), s.force.y(), s.force.z(), 0};
    S_ += S;
    XS_ += XS;
    for (int r = 0; r < 3; ++r) minus_XSX_.row[r] += cross(x4, XS.row[r]);
    force_ += f4;
    torque_ += cross(x4, f4);
  }
  [[nodiscard]] Matrix6 hessian() const {
    Matrix6 H;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        H(r, c) = S_.row[r][c];
        H(3 + r, c) = H(c, 3 + r) = XS_.row[r][c];
        H(3 + r, 3 + c) = r >= c ? minus_XSX_.row[r][c] : minus_XSX_.row[c][r];
      }
    }
    return H;
  }
  [[nodiscard]] Vector6 gradient() const {
    Vector6 g;
    g << force_[0], force_[1], force_[2], torque_[0], torque_[1], torque_[2];
    return g;
  }

 private:
  Rows3 S_, XS_, minus_XSX_;
  Packet4 force_ = {}, torque_ = {};
};

}  // namespace twofold
