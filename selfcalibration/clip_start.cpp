#include "selfcalibration/clip_start.hpp"

#include <algorithm>
#include <span>

#include "base/median.hpp"
#include "geometry/essential_matrix.hpp"
#include "geometry/inverse_depth.hpp"
#include "geometry/triangulation.hpp"
#include "geometry/view_rotation.hpp"

namespace twofold {
namespace {

constexpr double kThresholdPx = 1.5;
constexpr double kRotationPx = 6;  // translation moves corners beside what a rotation does
constexpr int kMaxSamples = 100;
constexpr double kMinParallax = 1e-3;  // [rad]

/// Fixed-point iterations: enough for a start.
Vector2 undistorted(const Vector2& q_d, const SharedLens& lens) {
  Vector2 q = q_d;
  for (int i = 0; i < 5; ++i) {
    const double r2 = q.squaredNorm();
    q = q_d / std::max(0.3, 1 + r2 * (lens.k1 + r2 * lens.k2));
  }
  return q;
}

/// Of the corners that `view` sees, as another one sees them.
std::vector<Vector3> rays(const ClipView& of, const ClipView& view, const SharedLens& lens) {
  std::vector<Vector3> rays;
  for (std::size_t i = 0; i < of.uv.size(); ++i) {
    if (!view.sees(i)) continue;
    const Vector2 q = undistorted((of.uv[i] - lens.centre) / lens.f(), lens);
    rays.emplace_back(q.x(), q.y(), 1);
  }
  return rays;
}

/// Median inverse depth one.
void scale_to_one(ClipMotion& motion) {
  std::vector<double> rho;
  for (const Vector3& psi : motion.psi) rho.push_back(psi.z());
  const double unit = std::max(median(std::span(rho)), 1e-6);
  for (Vector3& psi : motion.psi) psi.z() /= unit;
  for (SE3& T : motion.T_view_first) T.translation() *= unit;
}

}  // namespace

ClipMotion start_by_rotation(const Clip& clip, const SharedLens& lens) {
  const ClipView& first = clip.views.front();
  ClipMotion motion;
  motion.psi = rays(first, first, lens);
  RansacOptions options;
  options.threshold = kRotationPx / lens.f();
  options.max_iterations = kMaxSamples;
  for (const ClipView& view : clip.views) {
    SE3 T = motion.T_view_first.empty() ? SE3() : motion.T_view_first.back();
    if (!motion.T_view_first.empty()) {
      if (const auto rotation =
              estimate_view_rotation(rays(first, view, lens), rays(view, view, lens), options))
        T = SE3(rotation->R_b_a, Vector3::Zero());
    }
    motion.T_view_first.push_back(T);
  }
  return motion;
}

ClipMotion start_by_essential_matrix(const Clip& clip, const SharedLens& lens) {
  const ClipView &front = clip.views.front(), &back = clip.views.back();
  const std::vector<Vector3> first = rays(front, back, lens), last = rays(back, back, lens);
  RansacOptions options;
  options.threshold = kThresholdPx / lens.f();
  options.max_iterations = kMaxSamples;
  const auto pose = estimate_relative_pose(first, last, options);
  if (!pose) return start_by_rotation(clip, lens);
  ClipMotion motion;
  motion.psi = rays(front, front, lens);
  std::size_t pair = 0;
  for (std::size_t i = 0; i < motion.psi.size(); ++i) {
    if (!back.sees(i)) continue;
    const auto x = triangulate_midpoint(first[pair].normalized(), last[pair].normalized(),
                                        pose->T_b_a.inverse(), kMinParallax);
    motion.psi[i].z() = x && x->z() > 0 ? 1 / x->z() : 0.01;
    ++pair;
  }
  const Vector6 way = pose->T_b_a.log();
  const auto steps = static_cast<double>(clip.views.size() - 1);
  for (std::size_t k = 0; k < clip.views.size(); ++k)
    motion.T_view_first.push_back(SE3::exp(way * (static_cast<double>(k) / steps)));
  scale_to_one(motion);
  return motion;
}

}  // namespace twofold
