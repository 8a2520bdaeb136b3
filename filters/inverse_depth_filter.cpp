#include "filters/inverse_depth_filter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "camera/measurement.hpp"
#include "estimation/levenberg_marquardt.hpp"

namespace twofold {

// In units of the point's depth in its anchor frame, h = q x_c = R (x/z, y/z, 1) + q t, nothing is divided by
// q.
std::optional<InverseDepthProjection> project_inverse_depth(const Rig& rig, const SE3& T_c_a,
                                                            const Vector3& psi) {
  const double q = psi.z();
  const Vector3 ray_a(psi.x(), psi.y(), 1);
  const Matrix3 R = T_c_a.rotation();
  const Vector3& t = T_c_a.translation();
  const Vector3 h = R * ray_a + q * t;
  if (!in_front_of_camera(h)) return std::nullopt;
  const double fx = rig.camera.fx, fy = rig.camera.fy, b = rig.baseline, z = h.z();
  const Vector2 uv = rig.camera.project(h);
  InverseDepthProjection result;
  result.z_hat << uv, uv.x() - fx * b * q / z;
  Matrix3 J;                              // of z_hat by h
  J << fx / z, 0, -fx * h.x() / (z * z),  //
      0, fy / z, -fy * h.y() / (z * z),   //
      fx / z, 0, -fx * (h.x() - b * q) / (z * z);
  result.J_camera << q * J, -J * hat(h);
  const Matrix3 JR = J * R;
  result.J_anchor << -q * JR, JR * hat(ray_a);  // h = q T_c_w T_a_w^-1 exp(-d) x_a
  result.J_psi << JR.leftCols<2>(), J * t - Vector3(0, 0, fx * b / z);
  return result;
}

InverseDepthFilter InverseDepthFilter::from_mono(const PinholeCamera& camera, const Vector2& uv,
                                                 double sigma_px, double start_inverse_depth) {
  InverseDepthFilter filter;
  filter.psi = camera.unproject(uv);
  filter.psi.z() = start_inverse_depth;
  const double s2 = sigma_px * sigma_px;
  filter.information.diagonal() << camera.fx * camera.fx / s2, camera.fy * camera.fy / s2, 0;
  return filter;
}

InverseDepthFilter InverseDepthFilter::from_stereo(const Rig& rig, const StereoPixel& z, double sigma_px) {
  InverseDepthFilter filter;
  filter.psi = rig.camera.unproject(z.head<2>());
  filter.psi.z() = (z.x() - z.z()) / (rig.camera.fx * rig.baseline);  // eq. 4.23
  const double fx = rig.camera.fx;
  Matrix3 J;
  J << fx, 0, 0, 0, rig.camera.fy, 0, fx, 0, -fx * rig.baseline;
  filter.information = J.transpose() * J / (sigma_px * sigma_px);
  return filter;
}

namespace {

/// A measurement against its prediction.
struct Innovation {
  Vector3 d;  ///< z - z_hat; the third component 0 where the measurement has none
  Matrix3 J;  ///< of z_hat by psi, likewise
};

/// None when the point is behind the camera.
std::optional<Innovation> innovation(const Rig& rig, const SE3& T_c_a, const Vector3& psi,
                                     const StereoPixel& z) {
  const auto p = project_inverse_depth(rig, T_c_a, psi);
  if (!p) return std::nullopt;
  Innovation result{z - p->z_hat, p->J_psi};
  if (has_right(z)) return result;
  result.d.z() = 0;
  result.J.row(2).setZero();
  return result;
}

}  // namespace

bool InverseDepthFilter::update(const Rig& rig, const SE3& T_c_a, const StereoPixel& z, double sigma_px,
                                int iterations) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double weight = 1 / (sigma_px * sigma_px);
  const auto cost = [&](const Vector3& at, const std::optional<Innovation>& seen) {
    const Vector3 moved = at - psi;
    return seen ? moved.dot(information * moved) + weight * seen->d.squaredNorm() : kInfinity;
  };
  Vector3 at = psi;
  auto seen = innovation(rig, T_c_a, at, z);
  double best = cost(at, seen);
  if (!std::isfinite(best)) return false;
  double damping = 1e-6;
  for (int i = 0; i < iterations; ++i) {
    Matrix3 H = information + weight * seen->J.transpose() * seen->J;
    const Vector3 g = weight * seen->J.transpose() * seen->d - information * (at - psi);
    // The floor keeps a depth that this measurement says nothing about where it is.
    H.diagonal() += damping * (H.diagonal() + Vector3::Ones());
    const Vector3 delta = H.ldlt().solve(g);
    const Vector3 next = at + delta;
    const auto next_seen = delta.allFinite() ? innovation(rig, T_c_a, next, z) : std::nullopt;
    const double value = cost(next, next_seen);
    if (value > best) {
      damping = raised_damping(damping, 1e-3);
      continue;
    }
    at = next;
    seen = next_seen;
    const bool settled = best - value < 1e-10;
    best = value;
    damping *= 0.1;
    if (settled) break;
  }
  psi = at;
  information += weight * seen->J.transpose() * seen->J;  // eq. 3.37
  return true;
}

double InverseDepthFilter::inverse_depth_sigma() const {
  // Schur complement of the image coordinates: information about psi_3 alone.
  const Eigen::LDLT<Eigen::Matrix2d> image(information.topLeftCorner<2, 2>());
  const Vector2 cross = information.topRightCorner<2, 1>();
  const double left = information(2, 2) - cross.dot(Vector2(image.solve(cross)));
  return left > 1e-12 * information(2, 2) && left > 0 ? 1 / std::sqrt(left)
                                                      : std::numeric_limits<double>::infinity();
}

}  // namespace twofold
