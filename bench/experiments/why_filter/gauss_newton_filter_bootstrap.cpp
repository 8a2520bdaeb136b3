// Monocular start of the Gauss-Newton filter from three frames  (thesis 4.5.3).
#include <Eigen/Dense>
#include <algorithm>
#include <iterator>

#include "experiments/why_filter/gauss_newton_filter.hpp"
#include "filters/anchored_views.hpp"
#include "filters/sliding_window_filter_prior.hpp"

namespace twofold::bench {
namespace {

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
  std::vector<PointObservation> in_all;
  std::copy_if(b0.begin(), b0.end(), std::back_inserter(in_all),
               [&](const PointObservation& o) { return contains(b1, o.point) && contains(first, o.point); });
  add_points(in_all, 0);
  AnchoredViews views{rig_.camera, options_.sigma_px, {}, {}};
  for (int j = 0; j < point_count(); ++j) {
    const Vector3& psi = points_[static_cast<std::size_t>(j)].psi;
    views.points.push_back({psi, psi, Lambda_.block<3, 3>(point_at(j), point_at(j))});
  }
  // Six unknowns of the motion and three a point, one of them, scale, free.
  views.views.push_back(all_seen_from(SE3(), match(b1)));
  if (views.points.size() < 6 || !views.minimise(options_.two_view_iterations)) return false;
  if (!views.normalise_scale() || !start_from(views)) return false;

  // Third frame: a standard update after the second pose is marginalised; if all goes well, only its start.
  const std::vector<Seen> third = match(first);
  estimate_motion(third);
  views.views.push_back(all_seen_from(T_c_w_, third));
  // Two frames of little parallax leave depths and direction of motion too far off to take derivatives at for
  // good. All three are brought to their common minimum, where the information is taken afresh.
  if (!views.minimise(options_.three_view_iterations) || !views.normalise_scale() || !start_from(views)) {
    append_pose();
    if (!joint_update(third, options_.three_view_iterations)) return false;
  }
  reference_ = kCurrentPose;
  return true;
}

/// A view that saw every point.
AnchoredViews::View GaussNewtonFilter::all_seen_from(const SE3& T_c_a, const std::vector<Seen>& seen) const {
  AnchoredViews::View view{T_c_a, std::vector<Vector2>(points_.size())};
  for (const Seen& s : seen) view.pixels[static_cast<std::size_t>(s.point)] = s.pixel.head<2>();
  return view;
}

/// Takes over the views' minimum and information, the second pose, whose distance is the unit of length,
/// marginalised. False, and nothing changed, if a point is behind a camera.
bool GaussNewtonFilter::start_from(const AnchoredViews& views) {
  const MatrixX full = views.information();
  if (full.size() == 0) return false;
  const bool three = views.views.size() == 2;
  for (std::size_t j = 0; j < points_.size(); ++j) {
    points_[j].psi = views.points[j].psi;
    // Before the third frame nothing has been linearised for good.
    if (three) points_[j].psi_lin = points_[j].psi;
  }
  T_c_w_ = views.views.back().T_c_a;
  Lambda_ = without_second_pose(full, 3 * point_count(),
                                motions_of_fixed_length(views.views[0].T_c_a.translation()));
  return true;
}

}  // namespace twofold::bench
