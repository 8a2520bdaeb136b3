// What the Gauss-Newton filter keeps: points, anchors and the current pose enter and leave its information
// matrix  (thesis 4.5.2).
#include <algorithm>
#include <numeric>

#include "experiments/why_filter/gauss_newton_filter.hpp"
#include "filters/sliding_window_filter_prior.hpp"

namespace twofold::bench {
namespace {

/// Rows and columns of `m` in the given order.
MatrixX reordered(const MatrixX& m, const std::vector<int>& order) {
  const auto n = static_cast<Eigen::Index>(order.size());
  MatrixX result(n, n);
  for (Eigen::Index c = 0; c < n; ++c) {
    for (Eigen::Index r = 0; r < n; ++r) {
      result(r, c) = m(order[static_cast<std::size_t>(r)], order[static_cast<std::size_t>(c)]);
    }
  }
  return result;
}

}  // namespace

/// Inserts points and their own information before the current pose.
void GaussNewtonFilter::add_points(std::span<const PointObservation> observations, int anchor) {
  const int at = pose_at(), added = 3 * static_cast<int>(observations.size());
  MatrixX grown = MatrixX::Zero(at + added + 6, at + added + 6);
  grown.topLeftCorner(at, at) = Lambda_.topLeftCorner(at, at);
  grown.topRightCorner(at, 6) = Lambda_.topRightCorner(at, 6);
  grown.bottomLeftCorner(6, at) = Lambda_.bottomLeftCorner(6, at);
  grown.bottomRightCorner<6, 6>() = Lambda_.bottomRightCorner<6, 6>();
  for (const PointObservation& observation : observations) {
    const InverseDepthFilter start = first_estimate(observation.pixel);
    points_.push_back({observation.point, anchor, start.psi});
    const int own = point_at(point_count() - 1);
    grown.block<3, 3>(own, own) = start.information;
  }
  Lambda_ = std::move(grown);
}

void GaussNewtonFilter::eliminate(const std::vector<int>& indices) {
  if (indices.empty()) return;
  std::vector<bool> gone(static_cast<std::size_t>(Lambda_.rows()));
  for (const int i : indices) gone[static_cast<std::size_t>(i)] = true;
  std::vector<int> order = indices;
  for (int i = 0; i < Lambda_.rows(); ++i) {
    if (!gone[static_cast<std::size_t>(i)]) order.push_back(i);
  }
  MatrixX Lambda = reordered(Lambda_, order);
  VectorX g = VectorX::Zero(Lambda.rows());  // the estimate is the mean: nothing to shift
  schur_marginalise(Lambda, g, static_cast<int>(indices.size()), FillIn::kFull);
  Lambda_ = std::move(Lambda);
}

void GaussNewtonFilter::marginalise_pose() {  // eq. 4.25
  std::vector<int> indices(6);
  std::iota(indices.begin(), indices.end(), pose_at());
  if (Lambda_.bottomRightCorner<6, 6>().isZero(0)) {
    Lambda_.conservativeResize(pose_at(), pose_at());
  } else {
    eliminate(indices);
  }
}

/// The old pose moves from the end of the state to the end of the anchors.
void GaussNewtonFilter::pose_becomes_anchor() {
  const int anchors_end = 6 * anchor_count(), pose = pose_at();
  std::vector<int> order(static_cast<std::size_t>(pose) + 6);
  std::iota(order.begin(), order.end(), 0);
  std::rotate(order.begin() + anchors_end, order.begin() + pose, order.end());
  Lambda_ = reordered(Lambda_, order);
  anchors_.push_back(T_c_w_);
  anchors_lin_.push_back(T_c_w_);
}

void GaussNewtonFilter::append_pose() {  // eq. 4.20: uniform prior on the new pose
  const auto n = Lambda_.rows();
  Lambda_.conservativeResize(n + 6, n + 6);
  Lambda_.bottomRows(6).setZero();
  Lambda_.rightCols(6).setZero();
}

/// Also marginalises anchors that no point uses any more, except the reference. Expects the state without
/// current pose.
void GaussNewtonFilter::marginalise_points(std::span<const std::int64_t> lost) {
  std::vector<int> indices;
  std::vector<Point> kept;
  std::vector<int> users(anchors_.size());
  for (int j = 0; j < point_count(); ++j) {
    const Point& point = points_[static_cast<std::size_t>(j)];
    if (std::find(lost.begin(), lost.end(), point.id) == lost.end()) {
      kept.push_back(point);
      ++users[static_cast<std::size_t>(point.anchor)];
      continue;
    }
    for (int i = 0; i < 3; ++i) indices.push_back(point_at(j) + i);
  }
  std::vector<int> renumber(anchors_.size());
  std::vector<SE3> anchors = {anchors_[0]}, anchors_lin = anchors;
  const auto newest = static_cast<int>(anchors_.size()) - 1;  // about to get points
  for (int a = 1; a <= newest; ++a) {
    if (users[static_cast<std::size_t>(a)] == 0 && a != newest && a != reference_) {
      for (int i = 0; i < 6; ++i) indices.push_back(anchor_at(a) + i);
      continue;
    }
    renumber[static_cast<std::size_t>(a)] = static_cast<int>(anchors.size());
    anchors.push_back(anchors_[static_cast<std::size_t>(a)]);
    anchors_lin.push_back(anchors_lin_[static_cast<std::size_t>(a)]);
  }
  eliminate(indices);
  if (reference_ > 0) reference_ = renumber[static_cast<std::size_t>(reference_)];
  for (Point& point : kept) point.anchor = renumber[static_cast<std::size_t>(point.anchor)];
  points_ = std::move(kept);
  anchors_ = std::move(anchors);
  anchors_lin_ = std::move(anchors_lin);
}

}  // namespace twofold::bench
