#pragma once

#include <cstdint>

#include "geometry/se2.hpp"
#include "geometry/se3.hpp"
#include "geometry/sim3.hpp"

namespace twofold {

/// Lie bracket [a, b] = (a^ b^ - b^ a^)v in minimal coordinates  (thesis A.14, A.16, A.18).
/// The group is named because so(3) and se(2) share their dimension.
template <class Group>
[[nodiscard]] typename Group::Tangent lie_bracket(const typename Group::Tangent& a,
                                                  const typename Group::Tangent& b);

/// D = d [y, d] / d y, which does not depend on y  (A.15, A.17, A.19). D = -ad_d.
template <class Group>
[[nodiscard]] typename Group::AdjointMatrix lie_bracket_jacobian(const typename Group::Tangent& d);

/// Where the Campbell-Baker-Hausdorff series is cut off.
enum class CbhOrder : std::uint8_t { kFirst = 1, kSecond = 2, kThird = 3, kExact = 4 };

/// d log(exp(y) exp(d)) / d y at y = 0.
///
/// kFirst: I.  kSecond: I + D/2.  kThird: I + D/2 + D^2/12  (A.48 - A.50).
/// kExact: the whole series I + D/2 + sum_n B_2n/(2n)! D^2n, B the Bernoulli numbers: in closed form where D
/// has a short minimal polynomial (SO3, SE2, SE3), summed to double precision for Sim3. Needs |w| < 2 pi,
/// which log guarantees.
template <class Group>
[[nodiscard]] typename Group::AdjointMatrix cbh_jacobian(const typename Group::Tangent& d, CbhOrder order);

/// J_A^B = d log(A exp(e) B) / d e at e = 0, given d = log(A B)  (eq. 5.20 - 5.22).
template <class Group>
[[nodiscard]] typename Group::AdjointMatrix pose_pose_jacobian(const Group& A,
                                                               const typename Group::Tangent& d,
                                                               CbhOrder order) {
  if (order == CbhOrder::kFirst) return A.adjoint();
  return cbh_jacobian<Group>(d, order) * A.adjoint();
}

}  // namespace twofold
