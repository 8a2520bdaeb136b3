#include "imaging/plane_warp.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "imaging/level_pixels.hpp"

namespace twofold {
namespace {

constexpr double kMaxScale = 4;       // of one pixel of the patch in the view, and of its inverse
constexpr double kMinCosine = 0.02;   // determinant share below which the plane is seen from its edge
constexpr double kGoodEnough = 0.03;  // [level px] last step when iterations ran out

Matrix3 calibration_matrix(const PinholeCamera& camera) {
  Matrix3 K;
  K << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
  return K;
}

/// Bilinear value; false outside.
bool sample(const cv::Mat& image, double u, double v, float& value) {
  if (!(u >= 0) || !(v >= 0) || u > image.cols - 1.001 || v > image.rows - 1.001) return false;
  const int u0 = static_cast<int>(u), v0 = static_cast<int>(v);
  const auto a = static_cast<float>(u - u0), b = static_cast<float>(v - v0);
  const std::uint8_t* p = image.ptr<std::uint8_t>(v0) + u0;
  const std::uint8_t* q = p + image.step;
  const float top = static_cast<float>(p[0]) + a * (static_cast<float>(p[1]) - static_cast<float>(p[0]));
  const float bottom = static_cast<float>(q[0]) + a * (static_cast<float>(q[1]) - static_cast<float>(q[0]));
  value = top + b * (bottom - top);
  return true;
}

using Pixels = Eigen::Array<float, SurfacePatch::kArea, 1>;
using PixelsView = Eigen::Map<const Pixels, Eigen::Aligned32>;

/// Least squares for the residual view - (gain T + offset) over (move, gain, offset); T has no mean.
struct SurfacePatchEquations {
  Pixels J_u, J_v, T;
  float mean = 0;
  Eigen::Matrix4f inverse;

  /// @param A_v_r  level pixels of the view by pixels of the patch
  SurfacePatchEquations(const SurfacePatch& patch, const Eigen::Matrix2d& A_v_r, bool along_row) {
    const PixelsView value(patch.value), gu(patch.gradient_u), gv(patch.gradient_v);
    // A move in the view is A^-1 of it in the patch: the gradient by the view's pixels.
    const Eigen::Matrix2f A_r_v = A_v_r.inverse().cast<float>();
    J_u = gu * A_r_v(0, 0) + gv * A_r_v(1, 0);
    J_v = along_row ? Pixels(Pixels::Zero()) : Pixels(gu * A_r_v(0, 1) + gv * A_r_v(1, 1));
    mean = value.mean();
    T = value - mean;
    Eigen::Matrix<float, SurfacePatch::kArea, 4> J;
    J << J_u.matrix(), J_v.matrix(), T.matrix(), Eigen::VectorXf::Ones(SurfacePatch::kArea);
    Eigen::Matrix4f H = J.transpose() * J;
    // A direction without gradient cannot be placed: the damping keeps H invertible, and the step small
    // there.
    for (const int i : {0, 1}) H(i, i) += 1e-3F * H(i, i) + 1.0F;
    H(2, 2) += 1.0F;
    inverse = H.inverse();
  }

  Eigen::Vector4f step(const Pixels& view, float gain, float offset, float& squares) const {
    const Pixels r = view - gain * T - offset;
    squares = r.square().sum();
    return inverse * Eigen::Vector4f((J_u * r).sum(), (J_v * r).sum(), (T * r).sum(), r.sum());
  }
};

/// The level of the view's pyramid at which the patch has about its own size; none where the plane is seen
/// from its edge, too large or too small.
/// @param A_v_r  level-0 pixels of the view by pixels of the patch
std::optional<int> level_of_patch(const Eigen::Matrix2d& A_v_r) {
  const double determinant = A_v_r.determinant();
  const double longest = A_v_r.norm();
  if (!(determinant > kMinCosine * longest * longest) || determinant > kMaxScale * kMaxScale ||
      determinant < 1 / (kMaxScale * kMaxScale)) {
    return std::nullopt;
  }
  return std::clamp(static_cast<int>(std::lround(0.5 * std::log2(determinant))), 0, 2);
}

}  // namespace

std::optional<Matrix3> plane_homography(const PinholeCamera& camera, const SE3& T_v_r, const Vector3& x_r,
                                        const Vector3& n_r) {
  const double d_r = n_r.dot(x_r);
  if (!(std::abs(d_r) > 1e-9)) return std::nullopt;
  const Matrix3 K = calibration_matrix(camera);
  const Matrix3 plane = T_v_r.rotation().matrix() + T_v_r.translation() * n_r.transpose() / d_r;
  return K * plane * K.inverse();
}

Eigen::Matrix2d map_pixel_jacobian(const Matrix3& H, const Vector2& uv) {
  const Vector3 p = H * uv.homogeneous();
  const Vector2 mapped = p.head<2>() / p.z();
  return (H.topLeftCorner<2, 2>() - mapped * H.row(2).head<2>()) / p.z();
}

bool cut_surface_patch(const cv::Mat& image, const Vector2& uv, SurfacePatch& patch) {
  constexpr int kBordered = SurfacePatch::kSize + 2;
  float around[kBordered * kBordered];
  for (int r = 0; r < kBordered; ++r) {
    for (int c = 0; c < kBordered; ++c) {
      const double u = uv.x() + c - SurfacePatch::kHalf - 1, v = uv.y() + r - SurfacePatch::kHalf - 1;
      if (!sample(image, u, v, around[r * kBordered + c])) return false;
    }
  }
  patch.uv = uv;
  for (int r = 0; r < SurfacePatch::kSize; ++r) {
    for (int c = 0; c < SurfacePatch::kSize; ++c) {
      const float* p = around + (r + 1) * kBordered + c + 1;
      const int i = r * SurfacePatch::kSize + c;
      patch.value[i] = *p;
      patch.gradient_u[i] = 0.5F * (p[1] - p[-1]);
      patch.gradient_v[i] = 0.5F * (p[kBordered] - p[-kBordered]);
    }
  }
  return true;
}

std::optional<SurfaceAlignment> align_surface_patch(const SurfacePatch& patch, const Matrix3& H_v_r,
                                                    const ImagePyramid& view,
                                                    const SurfaceAlignmentOptions& options) {
  const Eigen::Matrix2d A_0 = map_pixel_jacobian(H_v_r, patch.uv);
  const auto level = level_of_patch(A_0);
  if (!level) return std::nullopt;
  const double scale = std::ldexp(1.0, -*level);
  const cv::Mat& image = view.level(*level);
  Vector2 places[SurfacePatch::kArea];
  for (int i = 0; i < SurfacePatch::kArea; ++i) {
    const Vector2 offset(i % SurfacePatch::kSize - SurfacePatch::kHalf,
                         i / SurfacePatch::kSize - SurfacePatch::kHalf);
    const Vector2 uv = map_pixel(H_v_r, patch.uv + offset);
    places[i] = {to_level(uv.x(), *level), to_level(uv.y(), *level)};
  }
  const SurfacePatchEquations equations(patch, scale * A_0, options.along_row);
  Vector2 move(0, 0);
  float gain = 1, offset = equations.mean;
  double last = 0;
  SurfaceAlignment result;
  Pixels window;
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    for (int i = 0; i < SurfacePatch::kArea; ++i) {
      if (!sample(image, places[i].x() + move.x(), places[i].y() + move.y(), window[i])) return std::nullopt;
    }
    float squares = 0;
    const Eigen::Vector4f step = equations.step(window, gain, offset, squares);
    const Vector2 d = step.head<2>().cast<double>() / gain;
    move -= d;
    gain += step[2];
    offset += step[3];
    result.rms = std::sqrt(squares / SurfacePatch::kArea);
    if (!(gain > 0.3F) || gain > 3.0F || move.cwiseAbs().maxCoeff() > options.max_move_px)
      return std::nullopt;
    last = d.norm();
    if (last < options.settled_px) break;
  }
  if (last > std::max(kGoodEnough, options.settled_px)) return std::nullopt;
  result.uv = map_pixel(H_v_r, patch.uv) + move / scale;
  return result;
}

}  // namespace twofold
