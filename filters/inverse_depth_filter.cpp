#include "filters/inverse_depth_filter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

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
  if (!(h.z() > kNearestDepth * std::max(q, 1.0))) return std::nullopt;
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

InverseDepthFilter InverseDepthFilter::from_stereo(const Rig& rig, const Vector3& z, double sigma_px) {
  InverseDepthFilter filter;
  filter.psi = rig.camera.unproject(z.head<2>());
  filter.psi.z() = (z.x() - z.z()) / (rig.camera.fx * rig.baseline);  // eq. 4.23
  const double fx = rig.camera.fx;
  Matrix3 J;
  J << fx, 0, 0, 0, rig.camera.fy, 0, fx, 0, -fx * rig.baseline;
  filter.information = J.transpose() * J / (sigma_px * sigma_px);
  return filter;
}

bool InverseDepthFilter::update(const Rig& rig, const SE3& T_c_a, const Vector3& z, double sigma_px,
                                int iterations) {
  const bool stereo = !std::isnan(z.z());
  const double weight = 1 / (sigma_px * sigma_px);
  const auto residual = [&](const Vector3& z_hat) {
    Vector3 r = z - z_hat;
    if (!stereo) r.z() = 0;
    return r;
  };
  const Vector3 prior = psi;
  const auto cost = [&](const Vector3& at) {
    const auto p = project_inverse_depth(rig, T_c_a, at);
    if (!p) return std::numeric_limits<double>::infinity();
    const Vector3 d = at - prior;
    return d.dot(information * d) + weight * residual(p->z_hat).squaredNorm();
  };
  Vector3 at = psi;
  double best = cost(at);
  if (!std::isfinite(best)) return false;
  double damping = 1e-6;
  for (int i = 0; i < iterations; ++i) {
    const auto p = project_inverse_depth(rig, T_c_a, at);
    Matrix3 J = p->J_psi;
    if (!stereo) J.row(2).setZero();
    Matrix3 H = information + weight * J.transpose() * J;
    const Vector3 g = weight * J.transpose() * residual(p->z_hat) - information * (at - prior);
    // The floor keeps a depth that this measurement says nothing about where it is.
    H.diagonal() += damping * (H.diagonal() + Vector3::Ones());
    const Vector3 delta = H.ldlt().solve(g);
    const Vector3 next = at + delta;
    const double value = delta.allFinite() ? cost(next) : std::numeric_limits<double>::infinity();
    if (value > best) {
      damping = std::max(10 * damping, 1e-3);
      continue;
    }
    at = next;
    const bool done = best - value < 1e-10;
    best = value;
    damping *= 0.1;
    if (done) break;
  }
  const auto p = project_inverse_depth(rig, T_c_a, at);
  Matrix3 J = p->J_psi;
  if (!stereo) J.row(2).setZero();
  psi = at;
  information += weight * J.transpose() * J;  // eq. 3.37
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
