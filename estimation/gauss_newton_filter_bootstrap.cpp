// Monocular start of the Gauss-Newton filter from three frames  (thesis 4.5.3).
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "estimation/gauss_newton_filter.hpp"
#include "estimation/sliding_window_filter_prior.hpp"

namespace twofold {
namespace {

constexpr int kTwoViewIterations = 60;
constexpr int kThreeViewIterations = 20;
constexpr double kLeastGain = 1e-6;  // of the squared whitened error

using Matrix65 = Eigen::Matrix<double, 6, 5>;

/// Left perturbations (v, omega) of a pose that keep the length of t: d|t|^2 / 2 = t^T v.
Matrix65 motions_of_fixed_length(const Vector3& t) {
  const Eigen::JacobiSVD<Eigen::Matrix<double, 1, 3>, Eigen::FullPivHouseholderQRPreconditioner> svd(
      t.transpose(), Eigen::ComputeFullV);
  Matrix65 B = Matrix65::Zero();
  B.topLeftCorner<3, 2>() = svd.matrixV().rightCols<2>();
  B.bottomRightCorner<3, 3>().setIdentity();
  return B;
}

/// Information of [points | second pose | rest], the second pose, of five degrees of freedom, marginalised.
MatrixX without_second_pose(const MatrixX& full, int points, const Matrix65& B) {
  const auto rest = full.rows() - points - 6;
  MatrixX reduced(5 + points + rest, 5 + points + rest);
  MatrixX kept(full.rows(), points + rest);
  kept << full.leftCols(points), full.rightCols(rest);
  reduced.topLeftCorner<5, 5>() = B.transpose() * full.block<6, 6>(points, points) * B;
  reduced.topRightCorner(5, points + rest) = B.transpose() * kept.middleRows<6>(points);
  reduced.bottomLeftCorner(points + rest, 5) = reduced.topRightCorner(5, points + rest).transpose();
  reduced.bottomRightCorner(points + rest, points + rest) << kept.topRows(points), kept.bottomRows(rest);
  VectorX g = VectorX::Zero(reduced.rows());
  schur_marginalise(reduced, g, 5, FillIn::kFull);
  return reduced;
}

bool contains(std::span<const PointObservation> list, std::int64_t id) {
  return std::any_of(list.begin(), list.end(), [id](const PointObservation& o) { return o.point == id; });
}

}  // namespace

bool GaussNewtonFilter::bootstrap(std::span<const PointObservation> b0, std::span<const PointObservation> b1,
                                  std::span<const PointObservation> first) {
  anchors_.assign(1, SE3());
  anchors_lin_.assign(1, SE3());
  points_.clear();
  T_c_w_ = SE3();
  Lambda_ = MatrixX::Zero(6, 6);
  for (const PointObservation& o : b0) {
    if (contains(b1, o.point) && contains(first, o.point)) add_point(o, 0);
  }
  const MatrixX own = Lambda_.topLeftCorner(pose_at(), pose_at());
  const std::vector<Point> start = points_;
  // Six unknowns of the motion and three a point, one of them, scale, free: held by the damping.
  TwoViews views{{match(b1), match(first)}, {}};
  if (views.seen[0].size() < 6 || !joint_update(views.seen[0], kTwoViewIterations, false)) return false;
  const double length = T_c_w_.translation().norm();
  if (!(length > 1e-9)) return false;
  T_c_w_.translation() /= length;
  for (Point& point : points_) point.psi.z() *= length;
  views.T_c_w[0] = T_c_w_;

  // Third frame: a standard update after the second pose is marginalised.
  MatrixX full = Lambda_;
  VectorX unused = VectorX::Zero(full.rows());
  if (!std::isfinite(add_measurements(views.seen[0], &full, &unused))) return false;
  Lambda_ = without_second_pose(full, pose_at(), motions_of_fixed_length(T_c_w_.translation()));
  estimate_motion(views.seen[1]);
  append_pose();
  if (!joint_update(views.seen[1], kThreeViewIterations, true)) return false;
  views.T_c_w[1] = T_c_w_;
  const Mean sequential = mean();
  const MatrixX information = Lambda_;
  if (!relinearise_bootstrap(own, start, views)) {  // a point behind a camera: the standard update stands
    set_mean(sequential);
    Lambda_ = information;
  }
  reference_ = kCurrentPose;
  return true;
}

/// Adds what both frames measure to [points | second pose | third pose]; returns the squared whitened error.
double GaussNewtonFilter::add_views(const TwoViews& views, MatrixX& H, VectorX& g) {
  const int points = pose_at();
  double chi2 = 0;
  for (const std::size_t k : {0U, 1U}) {
    T_c_w_ = views.T_c_w[k];
    MatrixX part = MatrixX::Zero(points + 6, points + 6);
    VectorX b = VectorX::Zero(points + 6);
    chi2 += add_measurements(views.seen[k], &part, &b);
    const int pose = points + 6 * static_cast<int>(k);
    H.topLeftCorner(points, points) += part.topLeftCorner(points, points);
    H.block(pose, 0, 6, points) += part.bottomLeftCorner(6, points);
    H.block(0, pose, points, 6) += part.topRightCorner(points, 6);
    H.block<6, 6>(pose, pose) += part.bottomRightCorner<6, 6>();
    g.head(points) += b.head(points);
    g.segment<6>(pose) += b.tail<6>();
  }
  return chi2;
}

/// Two frames of little parallax leave depths and direction of motion too far off to take derivatives at for
/// good. All three frames are brought to their common minimum, where the information is taken afresh.
bool GaussNewtonFilter::relinearise_bootstrap(const MatrixX& own, const std::vector<Point>& start,
                                              TwoViews views) {
  const int points = pose_at();
  MatrixX H(points + 12, points + 12);
  VectorX g(points + 12);
  const auto linearise = [&] {
    VectorX x(points);  // from what the first frame knows of each point: its direction
    for (int j = 0; j < point_count(); ++j) {
      const auto i = static_cast<std::size_t>(j);
      x.segment<3>(point_at(j)) = points_[i].psi - start[i].psi;
    }
    H.setZero();
    g.setZero();
    H.topLeftCorner(points, points) = own;
    g.head(points) = -(own * x);
    const double chi2 = -x.dot(g.head(points));
    return chi2 + add_views(views, H, g);
  };
  for (Point& point : points_) point.psi_lin.reset();
  double current = linearise(), damping = 1e-6;
  for (int iteration = 0; iteration < kThreeViewIterations && std::isfinite(current); ++iteration) {
    MatrixX damped = H;  // the floor holds the scale
    damped.diagonal() += damping * (H.diagonal() + VectorX::Ones(H.rows()));
    const VectorX delta = damped.llt().solve(g);
    const TwoViews old_views = views;
    const std::vector<Point> old_points = points_;
    for (int j = 0; j < point_count(); ++j) {
      points_[static_cast<std::size_t>(j)].psi += delta.segment<3>(point_at(j));
    }
    for (const int k : {0, 1}) {
      SE3& T = views.T_c_w[static_cast<std::size_t>(k)];
      T = SE3::exp(delta.segment<6>(points + 6 * k)) * T;
    }
    const double next = linearise();
    const bool better = next <= current;
    if (better && current - next < kLeastGain) break;
    damping = better ? 0.1 * damping : std::max(10 * damping, 1e-4);
    if (!better) {
      views = old_views;
      points_ = old_points;
    }
    current = linearise();
  }
  const double length = views.T_c_w[0].translation().norm();
  if (!(length > 1e-9)) return false;
  for (SE3& T : views.T_c_w) T.translation() /= length;
  for (Point& point : points_) {
    point.psi.z() *= length;
    point.psi_lin = point.psi;
  }
  if (!std::isfinite(linearise())) return false;
  Lambda_ = without_second_pose(H, points, motions_of_fixed_length(views.T_c_w[0].translation()));
  T_c_w_ = views.T_c_w[1];
  return true;
}

}  // namespace twofold
