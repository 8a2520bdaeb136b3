#include "geometry/homography.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "geometry/nearest_rotation.hpp"

namespace twofold {
namespace {

/// Least squares H of  b x (H a) = 0; zero for degenerate input.
Matrix3 fit_homography(std::span<const Vector3> a, std::span<const Vector3> b, std::span<const int> indices) {
  Eigen::Matrix<double, 9, 9> AtA = Eigen::Matrix<double, 9, 9>::Zero();
  for (const int i : indices) {
    const Vector3 p = a[i] / a[i].z();
    const Vector3 q = b[i] / b[i].z();
    Eigen::Matrix<double, 2, 9> rows;                        // H row-major
    rows << p.transpose(), 0, 0, 0, -q.x() * p.transpose(),  //
        0, 0, 0, p.transpose(), -q.y() * p.transpose();
    AtA += rows.transpose() * rows;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(AtA);
  if (eigen.info() != Eigen::Success) return Matrix3::Zero();
  const Eigen::Matrix<double, 9, 1> h = eigen.eigenvectors().col(0);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data());
}

struct HomographyEstimator {
  using Model = Matrix3;
  static constexpr int kSampleSize = 4;
  std::span<const Vector3> a, b;

  [[nodiscard]] int size() const { return static_cast<int>(std::min(a.size(), b.size())); }
  void fit(std::span<const int, 4> sample, std::vector<Matrix3>& models) const {
    models.push_back(fit_homography(a, b, sample));
  }
  [[nodiscard]] double squared_residual(const Matrix3& H_b_a, int i) const {
    const Vector3 mapped = H_b_a * a[i];
    const Vector2 error = mapped.head<2>() / mapped.z() - b[i].head<2>() / b[i].z();
    return error.allFinite() ? error.squaredNorm() : std::numeric_limits<double>::infinity();
  }
};

}  // namespace

std::optional<Homography> estimate_homography(std::span<const Vector3> bearings_a,
                                              std::span<const Vector3> bearings_b,
                                              const RansacOptions& options) {
  const HomographyEstimator data{bearings_a, bearings_b};
  const auto found = ransac(data, options);
  if (!found) return std::nullopt;
  Homography result{fit_homography(bearings_a, bearings_b, found->inliers), {}};
  for (int i = 0; i < data.size(); ++i) {
    if (data.squared_residual(result.H_b_a, i) <= options.threshold * options.threshold)
      result.inliers.push_back(i);
  }
  return result;
}

std::vector<SE3> decompose_homography(const Matrix3& H_b_a, const Vector3& bearing_a,
                                      const Vector3& bearing_b) {
  const auto svd = decompose(H_b_a);
  if (!svd) return {};
  const Vector3 s = svd->singular_values / svd->singular_values[1];
  constexpr double kTurnedOnTheSpot = 1e-9;
  if (!s.allFinite() || !(s[0] - s[2] > kTurnedOnTheSpot)) return {};
  Matrix3 H = H_b_a / svd->singular_values[1];
  if (bearing_b.dot(H * bearing_a) < 0) H = -H;
  Matrix3 V = svd->V;
  if (V.determinant() < 0) V = -V;
  const double along_1 = std::sqrt(std::max(0.0, 1 - s[2] * s[2]));
  const double along_3 = std::sqrt(std::max(0.0, s[0] * s[0] - 1));
  const double length = std::sqrt(s[0] * s[0] - s[2] * s[2]);
  std::vector<SE3> motions;
  for (const double sign : {1.0, -1.0}) {
    // v2 and u span a plane whose lengths and angles H keeps.
    const Vector3 u = (along_1 * V.col(0) + sign * along_3 * V.col(2)) / length;
    Matrix3 U, W;
    U << V.col(1), u, V.col(1).cross(u);
    const Vector3 Hv = H * V.col(1), Hu = H * u;
    W << Hv, Hu, Hv.cross(Hu);
    const Matrix3 R = W * U.transpose();
    const Vector3 t = (H - R) * U.col(2);
    if (!(t.norm() > 0)) continue;
    for (const double side : {1.0, -1.0}) motions.emplace_back(R, side * t.normalized());
  }
  return motions;
}

}  // namespace twofold
