#include "estimation/gauss_newton_filter.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <stdexcept>

#include "estimation/sliding_window_filter_prior.hpp"
#include "geometry/check.hpp"

namespace twofold {
namespace {

double thread_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

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

std::string GaussNewtonFilterOptions::invalid_reason() const {
  if (!(sigma_px > 0)) return "sigma_px must be > 0, is " + std::to_string(sigma_px);
  if (iterations < 0) return "iterations must be >= 0, is " + std::to_string(iterations);
  if (motion_iterations < 0) return "motion_iterations must be >= 0, is " + std::to_string(motion_iterations);
  return {};
}

GaussNewtonFilter::GaussNewtonFilter(const Rig& rig, const GaussNewtonFilterOptions& options)
    : rig_(rig), anchors_(1), Lambda_(MatrixX::Zero(6, 6)) {
  set_options(options);
}

void GaussNewtonFilter::set_options(const GaussNewtonFilterOptions& options) {
  const std::string reason = options.invalid_reason();
  if (!reason.empty()) throw std::runtime_error("Gauss-Newton filter: " + reason);
  options_ = options;
}

InverseDepthFilter GaussNewtonFilter::first_estimate(const Vector3& z) const {
  return rig_.kind == SensorKind::kMono
             ? InverseDepthFilter::from_mono(rig_.camera, z.head<2>(), options_.sigma_px)
             : InverseDepthFilter::from_stereo(rig_, z, options_.sigma_px);
}

void GaussNewtonFilter::initialise(std::span<const PointObservation> first) {
  TWOFOLD_CHECK(rig_.kind != SensorKind::kMono, "a monocular filter starts with bootstrap()");
  anchors_.assign(1, SE3());
  points_.clear();
  T_c_w_ = SE3();
  Lambda_ = MatrixX::Zero(6, 6);
  // The current pose is the origin itself: known, so its block holds no information to marginalise.
  for (const PointObservation& o : first) add_point(o, 0);
}

/// Inserts a point and its own information before the current pose.
void GaussNewtonFilter::add_point(const PointObservation& observation, int anchor) {
  const InverseDepthFilter start = first_estimate(observation.z);
  const int at = pose_at();
  MatrixX grown = MatrixX::Zero(at + 9, at + 9);
  grown.topLeftCorner(at, at) = Lambda_.topLeftCorner(at, at);
  grown.block<3, 3>(at, at) = start.information;
  grown.topRightCorner(at, 6) = Lambda_.topRightCorner(at, 6);
  grown.bottomLeftCorner(6, at) = Lambda_.bottomLeftCorner(6, at);
  grown.bottomRightCorner<6, 6>() = Lambda_.bottomRightCorner<6, 6>();
  Lambda_ = std::move(grown);
  points_.push_back({observation.point, anchor, start.psi});
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
  std::vector<int> indices;
  for (int i = 0; i < 6; ++i) indices.push_back(pose_at() + i);
  if (Lambda_.bottomRightCorner<6, 6>().isZero(0)) {
    Lambda_.conservativeResize(pose_at(), pose_at());
  } else {
    eliminate(indices);
  }
}

/// The old pose moves from the end of the state to the end of the anchors.
void GaussNewtonFilter::pose_becomes_anchor() {
  const int anchors_end = 6 * anchor_count(), pose = pose_at();
  std::vector<int> order;
  for (int i = 0; i < anchors_end; ++i) order.push_back(i);
  for (int i = 0; i < 6; ++i) order.push_back(pose + i);
  for (int i = anchors_end; i < pose; ++i) order.push_back(i);
  Lambda_ = reordered(Lambda_, order);
  anchors_.push_back(T_c_w_);
}

void GaussNewtonFilter::append_pose() {  // eq. 4.20: uniform prior on the new pose
  const auto n = Lambda_.rows();
  Lambda_.conservativeResize(n + 6, n + 6);
  Lambda_.bottomRows(6).setZero();
  Lambda_.rightCols(6).setZero();
}

/// Also marginalises anchors that no point uses any more. Expects the state without current pose.
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
  std::vector<SE3> anchors = {anchors_[0]};
  const auto newest = static_cast<int>(anchors_.size()) - 1;  // about to get points
  for (int a = 1; a <= newest; ++a) {
    if (users[static_cast<std::size_t>(a)] == 0 && a != newest) {
      for (int i = 0; i < 6; ++i) indices.push_back(anchor_at(a) + i);
      continue;
    }
    renumber[static_cast<std::size_t>(a)] = static_cast<int>(anchors.size());
    anchors.push_back(anchors_[static_cast<std::size_t>(a)]);
  }
  eliminate(indices);
  for (Point& point : kept) point.anchor = renumber[static_cast<std::size_t>(point.anchor)];
  points_ = std::move(kept);
  anchors_ = std::move(anchors);
}

bool GaussNewtonFilter::step(std::span<const std::int64_t> lost, std::span<const PointObservation> fresh,
                             std::span<const PointObservation> current) {
  if (fresh.empty()) {
    marginalise_pose();
    if (!lost.empty()) marginalise_points(lost);
  } else {
    // The origin needs no second copy of itself as an anchor.
    const bool at_origin = Lambda_.bottomRightCorner<6, 6>().isZero(0);
    if (at_origin) {
      marginalise_pose();
    } else {
      pose_becomes_anchor();
    }
    marginalise_points(lost);
    append_pose();
    const int anchor = at_origin ? 0 : anchor_count();
    for (const PointObservation& o : fresh) add_point(o, anchor);
    Lambda_.conservativeResize(pose_at(), pose_at());
  }
  const std::vector<Seen> seen = match(current);
  estimate_motion(seen);
  append_pose();
  return joint_update(seen, options_.iterations, true);
}

std::vector<GaussNewtonFilter::Seen> GaussNewtonFilter::match(
    std::span<const PointObservation> observations) const {
  std::vector<std::pair<std::int64_t, int>> index;
  for (int j = 0; j < point_count(); ++j) index.emplace_back(points_[static_cast<std::size_t>(j)].id, j);
  std::sort(index.begin(), index.end());
  std::vector<Seen> seen;
  for (const PointObservation& o : observations) {
    const auto found = std::lower_bound(index.begin(), index.end(), std::pair<std::int64_t, int>(o.point, 0));
    if (found != index.end() && found->first == o.point) seen.push_back({found->second, o.z});
  }
  return seen;
}

/// Algorithm 4. Adds D^T Lambda_z D and D^T Lambda_z d; returns the squared whitened error, infinity when a
/// point is behind the camera.
double GaussNewtonFilter::add_measurements(const std::vector<Seen>& seen, MatrixX* Lambda, VectorX* g) const {
  const double weight = 1 / (options_.sigma_px * options_.sigma_px);
  const int rows = this->rows(), pose = pose_at();
  std::vector<SE3> T_c_a;
  for (int a = 0; a <= anchor_count(); ++a) T_c_a.push_back(T_c_anchor(a));
  double chi2 = 0;
  for (const Seen& s : seen) {
    const Point& point = points_[static_cast<std::size_t>(s.point)];
    const auto p = project_inverse_depth(rig_, T_c_a[static_cast<std::size_t>(point.anchor)], point.psi);
    if (!p) return std::numeric_limits<double>::infinity();
    const VectorX d = (s.z - p->z_hat).head(rows);
    chi2 += weight * d.squaredNorm();
    if (Lambda == nullptr) continue;
    const int at = point_at(s.point);
    const Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 3, 6> J_T = p->J_camera.topRows(rows);
    const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3, 3> J_psi = p->J_psi.topRows(rows);
    const Matrix63 W = weight * J_T.transpose() * J_psi;
    Lambda->block<6, 6>(pose, pose) += weight * J_T.transpose() * J_T;
    Lambda->block<6, 3>(pose, at) += W;
    Lambda->block<3, 6>(at, pose) += W.transpose();
    Lambda->block<3, 3>(at, at) += weight * J_psi.transpose() * J_psi;
    g->segment<6>(pose) += weight * J_T.transpose() * d;
    g->segment<3>(at) += weight * J_psi.transpose() * d;
    if (point.anchor == 0) continue;
    const int anchor = anchor_at(point.anchor);
    const Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 3, 6> J_a = p->J_anchor.topRows(rows);
    const Matrix63 W_a = weight * J_a.transpose() * J_psi;
    const Matrix6 W_T = weight * J_T.transpose() * J_a;
    Lambda->block<6, 6>(anchor, anchor) += weight * J_a.transpose() * J_a;
    Lambda->block<6, 3>(anchor, at) += W_a;
    Lambda->block<3, 6>(at, anchor) += W_a.transpose();
    Lambda->block<6, 6>(pose, anchor) += W_T;
    Lambda->block<6, 6>(anchor, pose) += W_T.transpose();
    g->segment<6>(anchor) += weight * J_a.transpose() * d;
  }
  return chi2;
}

/// Levenberg-Marquardt on eq. 4.18, then Lambda += D^T Lambda_z D  (4.21). fixed_gauge false: the damping
/// holds the free scale and the information is left to the caller.
bool GaussNewtonFilter::joint_update(const std::vector<Seen>& seen, int iterations, bool fixed_gauge) {
  const double start = thread_seconds();
  const MatrixX prior = Lambda_;
  const std::vector<SE3> anchors0 = anchors_;
  const std::vector<Point> points0 = points_;
  const auto offset = [&] {  // Phi_i (-) Phi_i-1  (4.19)
    VectorX x = VectorX::Zero(Lambda_.rows());
    for (int a = 1; a <= anchor_count(); ++a) {
      const auto i = static_cast<std::size_t>(a);
      x.segment<6>(anchor_at(a)) = (anchors_[i] * anchors0[i].inverse()).log();
    }
    for (int j = 0; j < point_count(); ++j) {
      const auto i = static_cast<std::size_t>(j);
      x.segment<3>(point_at(j)) = points_[i].psi - points0[i].psi;
    }
    return x;
  };
  VectorX x = VectorX::Zero(Lambda_.rows());
  double current = add_measurements(seen, nullptr, nullptr);
  double damping = 1e-6;
  bool moved = false;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    MatrixX H = prior;
    VectorX g = -(prior * x);
    add_measurements(seen, &H, &g);
    const VectorX diagonal = H.diagonal();
    bool accepted = false;
    for (int attempt = 0; attempt < 8 && !accepted; ++attempt) {
      // Multiplicative damping plus a floor: a depth nobody has measured yet has a zero on the diagonal.
      H.diagonal() = diagonal + damping * (diagonal + VectorX::Constant(diagonal.size(), 1.0));
      MatrixX factor = H;
      const Eigen::LLT<Eigen::Ref<MatrixX>> llt(factor);
      const SE3 T_old = T_c_w_;
      const std::vector<SE3> anchors_old = anchors_;
      const std::vector<Point> points_old = points_;
      double next = std::numeric_limits<double>::infinity();
      VectorX x_next;
      if (llt.info() == Eigen::Success) {
        const VectorX delta = llt.solve(g);
        T_c_w_ = SE3::exp(delta.tail<6>()) * T_c_w_;
        for (int a = 1; a <= anchor_count(); ++a) {
          auto& T = anchors_[static_cast<std::size_t>(a)];
          T = SE3::exp(delta.segment<6>(anchor_at(a))) * T;
        }
        for (int j = 0; j < point_count(); ++j) {
          points_[static_cast<std::size_t>(j)].psi += delta.segment<3>(point_at(j));
        }
        x_next = offset();
        if (delta.allFinite()) next = x_next.dot(prior * x_next) + add_measurements(seen, nullptr, nullptr);
      }
      accepted = next <= current || (!std::isfinite(current) && std::isfinite(next));
      if (accepted) {
        current = next;
        x = x_next;
        moved = true;
        damping = std::max(0.1 * damping, 1e-12);
      } else {
        T_c_w_ = T_old;
        anchors_ = anchors_old;
        points_ = points_old;
        damping = std::max(10 * damping, 1e-4);
      }
    }
    if (!accepted) break;
  }
  if (fixed_gauge && std::isfinite(current)) {
    VectorX unused = VectorX::Zero(Lambda_.rows());
    add_measurements(seen, &Lambda_, &unused);
  }
  joint_seconds_ = thread_seconds() - start;
  return std::isfinite(current) && (moved || iterations == 0);
}

Vector3 GaussNewtonFilter::point_in_world(int point) const {
  const Point& p = points_[static_cast<std::size_t>(point)];
  return anchors_[static_cast<std::size_t>(p.anchor)].inverse() * from_inverse_depth(p.psi);
}

Matrix6 GaussNewtonFilter::pose_covariance() const {
  MatrixX unit = MatrixX::Zero(Lambda_.rows(), 6);
  unit.bottomRows<6>().setIdentity();
  return Lambda_.ldlt().solve(unit).bottomRows<6>();
}

}  // namespace twofold
