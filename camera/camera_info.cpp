#include "camera/camera_info.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "camera/opencv_distortion.hpp"

namespace twofold {
namespace {

/// The pinhole camera of a 3x3 or 3x4 matrix.
PinholeCamera pinhole_of(const double* matrix, std::size_t columns, const CameraInfoMessage& info) {
  return {matrix[0],           matrix[columns + 1],          matrix[2],
          matrix[columns + 2], static_cast<int>(info.width), static_cast<int>(info.height)};
}

tl::expected<Distortion, std::string> pinhole_distortion(const std::string& model, std::vector<double> D) {
  std::size_t used = D.size();
  while (used > 0 && D[used - 1] == 0) --used;
  if (used <= 5) {
    D.resize(5);
  } else if (model == "rational_polynomial") {
    D.resize(std::max<std::size_t>(D.size(), 8));
  }
  return opencv_distortion(D);
}

tl::expected<Distortion, std::string> fisheye_distortion(std::vector<double> D) {
  D.resize(std::max<std::size_t>(D.size(), 4));
  return equidistant_distortion(D);
}

tl::expected<Distortion, std::string> distortion_of(const CameraInfoMessage& info) {
  const std::string& model = info.distortion_model;
  const bool fisheye = model == "equidistant" || model == "fisheye";
  const bool zero = std::all_of(info.D.begin(), info.D.end(), [](double k) { return k == 0; });
  if (info.D.empty() || (zero && !fisheye)) return Distortion{};
  if (fisheye) return fisheye_distortion(info.D);
  if (model == "plumb_bob" || model == "rational_polynomial") return pinhole_distortion(model, info.D);
  return tl::make_unexpected("is not known");
}

/// t of P = K' [I | t]: where the origin that a pair's P share lies in this camera, turned as the rectified
/// one.
Vector3 shift_of(const CameraInfoMessage& info) {
  const auto& P = info.P;
  return {(P[3] - P[2] * P[11]) / P[0], (P[7] - P[6] * P[11]) / P[5], P[11]};
}

}  // namespace

tl::expected<CameraModel, std::string> raw_camera(const CameraInfoMessage& info) {
  auto distortion = distortion_of(info);
  if (!distortion)
    return tl::make_unexpected("the distortion '" + info.distortion_model + "' " + distortion.error());
  return CameraModel{raw_pinhole(info), *distortion};
}

PinholeCamera raw_pinhole(const CameraInfoMessage& info) {
  return pinhole_of(info.K.data(), 3, info);
}

PinholeCamera rectified_pinhole(const CameraInfoMessage& info) {
  return pinhole_of(info.P.data(), 4, info);
}

tl::expected<SO3, std::string> rectifying_rotation(const CameraInfoMessage& info) {
  const Matrix3 R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(info.R.data());
  constexpr double kTolerance = 1e-3;
  const double off = (R * R.transpose() - Matrix3::Identity()).norm();
  if (!(off <= kTolerance && R.determinant() > 0))
    return tl::make_unexpected(
        fmt::format("R is no rotation (|R R' - I| = {:.3g}, det R = {:.3g}): the images' poses are not known",
                    off, R.determinant()));
  return SO3(R);
}

tl::expected<Vector3, std::string> rectified_translation(const CameraInfoMessage& left,
                                                         const CameraInfoMessage& right) {
  constexpr double kTolerance = 1e-3;  // of the focal length
  if (!(std::abs(left.P[0] - right.P[0]) <= kTolerance * std::abs(right.P[0])))
    return tl::make_unexpected(
        fmt::format("focal lengths differ (P[0]: {:.6g} and {:.6g}), which no rectified pair's do", left.P[0],
                    right.P[0]));
  const Vector3 t = shift_of(right) - shift_of(left);
  if (!t.allFinite() || t.isZero() || t.norm() > 100)
    return tl::make_unexpected(
        fmt::format("the right camera states no baseline (P[3] is {:.6g})", right.P[3]));
  return t;
}

}  // namespace twofold
