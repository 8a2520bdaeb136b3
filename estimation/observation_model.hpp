#pragma once

#include <limits>

#include "camera/measurement.hpp"
#include "camera/rig.hpp"
#include "estimation/robust_kernel.hpp"
#include "geometry/types.hpp"

namespace twofold {

/// Solvers take a point nearer to the image plane than this for one behind the camera [m; of one camera, the
/// median depth that its map began with]. Far above rounding, but far below any depth that is seen, so that a
/// step may bring a point somewhat nearer.
inline constexpr double kSolverMinDepth = 1e-6;

/// Smallest inverse depth the solvers let a point take, in the inverse of that unit: points at infinity stay
/// representable and never slip through it to behind the camera.
inline constexpr double kMinInverseDepth = 1e-6;

/// Diagonal by which a point's 3x3 system is damped: its own, with a floor that keeps the system regular when
/// one coordinate is not seen at all (inverse depth of a point met once, without a right image).
[[nodiscard]] inline Vector3 damping_diagonal(const Matrix3& V) {
  return V.diagonal().cwiseMax(1e-6 * V.trace());
}

/// Stereo reprojection of a point x in the observing camera  (thesis B.5), reduced to what the normal
/// equations need. e = z_hat(x) - z, J = d z_hat / d x, W the diagonal information times the robust weight.
struct ObservationTerms {
  double chi2 = 0;  ///< e^T Lambda e, without the kernel
  Vector3 force;    ///< J^T W e
  /// S = J^T W J, symmetric; S_01 is zero because u depends on x and z, v on y and z only.
  double s00, s02, s11, s12, s22;

  /// S * v
  [[nodiscard]] Vector3 apply(const Vector3& v) const {
    return {s00 * v.x() + s02 * v.z(), s11 * v.y() + s12 * v.z(), s02 * v.x() + s12 * v.y() + s22 * v.z()};
  }
};

/// The rig's numbers as the inner loops want them.
struct ObservationModel {
  double fx, fy, cx, cy, baseline;

  explicit ObservationModel(const Rig& rig)
      : fx(rig.camera.fx), fy(rig.camera.fy), cx(rig.camera.cx), cy(rig.camera.cy), baseline(rig.baseline) {}

  /// Whitened squared error; infinity behind the camera (or for a NaN). z.z() may be NaN where it
  /// does not count (weighs_right).
  [[nodiscard]] double chi2(const Vector3& x, const StereoPixelF& z, const Eigen::Vector3f& info) const {
    if (!(x.z() > kSolverMinDepth)) return std::numeric_limits<double>::infinity();
    const double inv_z = 1.0 / x.z();
    const double eu = fx * x.x() * inv_z + cx - z.x();
    const double ev = fy * x.y() * inv_z + cy - z.y();
    const double mono = info.x() * eu * eu + info.y() * ev * ev;
    if (!weighs_right(info)) return mono;
    const double er = fx * (x.x() - baseline) * inv_z + cx - z.z();
    return mono + info.z() * er * er;
  }

  /// Needs a point in front of the camera.
  [[nodiscard]] ObservationTerms linearise(const Vector3& x, const StereoPixelF& z,
                                           const Eigen::Vector3f& info, const HuberKernel& kernel) const {
    const double inv_z = 1.0 / x.z();
    const double x_right = x.x() - baseline;
    const double eu = fx * x.x() * inv_z + cx - z.x();
    const double ev = fy * x.y() * inv_z + cy - z.y();
    const double er = weighs_right(info) ? fx * x_right * inv_z + cx - z.z() : 0.0;
    double wu = info.x(), wv = info.y(), wr = info.z();

    ObservationTerms terms;
    terms.chi2 = wu * eu * eu + wv * ev * ev + wr * er * er;
    const double weight = kernel.weight(terms.chi2);
    wu *= weight, wv *= weight, wr *= weight;

    const double a = fx * inv_z;
    const double c = fy * inv_z;
    const double u = x.x() * inv_z;    // J_u = a (1, 0, -u)
    const double v = x.y() * inv_z;    // J_v = c (0, 1, -v)
    const double r = x_right * inv_z;  // J_r = a (1, 0, -r)
    const double fu = a * wu * eu, fv = c * wv * ev, fr = a * wr * er;
    terms.force = Vector3(fu + fr, fv, -(u * fu + v * fv + r * fr));
    const double auu = a * a * wu, cvv = c * c * wv, arr = a * a * wr;
    terms.s00 = auu + arr;
    terms.s02 = -(auu * u + arr * r);
    terms.s11 = cvv;
    terms.s12 = -cvv * v;
    terms.s22 = auu * u * u + cvv * v * v + arr * r * r;
    return terms;
  }
};

}  // namespace twofold
