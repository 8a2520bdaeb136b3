// Removal of parameters from the sliding window filter  (SWF 3.1.2, 3.2, 4.2.4, 4.2.7).
#include <algorithm>

#include "filters/sliding_window_filter.hpp"

namespace twofold {

void SlidingWindowFilter::remove_oldest(const FilterFrame& frame) {
  const auto n = static_cast<std::size_t>(landmark_count());
  for (const Observation& o : poses_.front().observations)
    --landmarks_[static_cast<std::size_t>(o.landmark)].observations;
  std::vector<bool> drop(n);
  const bool keep = options_.keep_unseen_landmarks && options_.removal != PoseRemoval::kDelete;
  for (std::size_t l = 0; l < n; ++l) drop[l] = !keep && landmarks_[l].observations == 0;
  for (const LandmarkObservation& o : frame.observations) {
    const auto found = index_.find(o.landmark);
    if (found != index_.end()) drop[static_cast<std::size_t>(found->second)] = false;
  }
  summary_.landmarks_marginalised = static_cast<int>(std::count(drop.begin(), drop.end(), true));
  if (options_.removal == PoseRemoval::kDelete) {
    delete_oldest(drop);
  } else {
    marginalise_oldest(drop);
  }
}

void SlidingWindowFilter::delete_oldest(const std::vector<bool>& drop) {
  prior_ = FilterPrior{};
  poses_.pop_front();
  poses_.front().motion.reset();
  prior_.T_lin = poses_.front().T_c_l;
  oldest_fixed_ = true;
  std::vector<int> order;
  for (int l = 0; l < landmark_count(); ++l) {
    if (!drop[static_cast<std::size_t>(l)]) order.push_back(l);
  }
  compact_landmarks(order);
}

std::vector<int> SlidingWindowFilter::fill_in_blocks(std::size_t landmarks) const {
  if (options_.removal == PoseRemoval::kMarginaliseEntries) return std::vector<int>(3 * landmarks + 6, 1);
  std::vector<int> sizes(landmarks, 3);
  sizes.push_back(6);
  return sizes;
}

/// Everything the oldest pose or the prior touches: the oldest pose's Markov blanket. Unknowns are offsets
/// from the linearisation point: [oldest pose | dropped landmarks | kept landmarks | next pose].
struct SlidingWindowFilter::Blanket {
  std::vector<int> kept;  ///< landmarks of the next prior
  std::vector<int> rest;  ///< landmarks outside of the blanket
  std::vector<int> at;    ///< by landmark, its first row; -1 outside of the blanket
  int eliminated = 0;     ///< rows of the oldest pose and the dropped landmarks
  MatrixX Lambda;
  VectorX g;
  VectorX d;  ///< current state minus linearisation point
};

SlidingWindowFilter::Blanket SlidingWindowFilter::blanket_of_oldest(const std::vector<bool>& drop) const {
  std::vector<bool> touched(static_cast<std::size_t>(landmark_count()));
  std::fill_n(touched.begin(), prior_.landmark_count(), true);
  for (const Observation& o : poses_.front().observations)
    touched[static_cast<std::size_t>(o.landmark)] = true;
  Blanket blanket;
  std::vector<int> dropped;
  for (int l = 0; l < landmark_count(); ++l) {
    const auto i = static_cast<std::size_t>(l);
    (drop[i] ? dropped : touched[i] ? blanket.kept : blanket.rest).push_back(l);
  }
  int rows = 6;
  blanket.at.assign(touched.size(), -1);
  const auto place = [&](int landmark) {
    blanket.at[static_cast<std::size_t>(landmark)] = rows;
    rows += 3;
  };
  std::for_each(dropped.begin(), dropped.end(), place);
  blanket.eliminated = rows;
  std::for_each(blanket.kept.begin(), blanket.kept.end(), place);
  rows += 6;
  blanket.Lambda = MatrixX::Zero(rows, rows);
  blanket.g = VectorX::Zero(rows);
  blanket.d = VectorX::Zero(rows);
  return blanket;
}

/// Rows and columns move to their new places.
void SlidingWindowFilter::add_prior(Blanket& blanket) const {
  const int n_prior = prior_.landmark_count();
  const int pose_column = 3 * n_prior;
  const auto& at = blanket.at;
  const auto place = [&](int landmark) { return at[static_cast<std::size_t>(landmark)]; };
  MatrixX& Lambda = blanket.Lambda;
  for (int b = 0; b < n_prior; ++b) {
    for (int a = 0; a < n_prior; ++a) {
      Lambda.block<3, 3>(place(a), place(b)) = prior_.information.block<3, 3>(3 * a, 3 * b);
    }
    Lambda.block<6, 3>(0, place(b)) = prior_.information.block<6, 3>(pose_column, 3 * b);
    Lambda.block<3, 6>(place(b), 0) = prior_.information.block<3, 6>(3 * b, pose_column);
    blanket.g.segment<3>(place(b)) = prior_.vector.segment<3>(3 * b);
  }
  Lambda.topLeftCorner<6, 6>() = prior_.information.bottomRightCorner<6, 6>();
  blanket.g.head<6>() = prior_.vector.tail<6>();
  if (!first_estimates()) return;
  const VectorX d_prior = prior_.difference(points_, poses_.front().T_c_l, shift_);
  for (int a = 0; a < n_prior; ++a) blanket.d.segment<3>(place(a)) = d_prior.segment<3>(3 * a);
  if (pose_is_linearised_at_prior(0)) blanket.d.head<6>() = d_prior.tail<6>();
}

/// Of the oldest pose.
void SlidingWindowFilter::add_measurements(Blanket& blanket) const {
  auto& [kept, rest, at, eliminated, Lambda, g, d] = blanket;
  for (const Observation& o : poses_.front().observations) {
    const ObservationTerm term = linearise(0, o);
    if (!term.valid) continue;
    const int l = at[static_cast<std::size_t>(o.landmark)];
    const Vector3 r = term.r + term.J_pose * d.head<6>() + term.J_landmark * d.segment<3>(l);
    const Matrix63 W = term.J_pose.transpose() * term.information * term.J_landmark;
    Lambda.topLeftCorner<6, 6>() += term.J_pose.transpose() * term.information * term.J_pose;
    Lambda.block<3, 3>(l, l) += term.J_landmark.transpose() * term.information * term.J_landmark;
    Lambda.block<6, 3>(0, l) += W;
    Lambda.block<3, 6>(l, 0) += W.transpose();
    g.head<6>() += term.J_pose.transpose() * term.information * r;
    g.segment<3>(l) += term.J_landmark.transpose() * term.information * r;
  }
}

/// Process model from the oldest to the next pose.
void SlidingWindowFilter::add_motion(Blanket& blanket) const {
  if (pose_count() == 1 || !poses_[1].motion) return;
  const MotionError error = linearise_motion(1);
  Eigen::Matrix<double, 6, 12> J;
  J << error.J_prev, error.J_cur;
  const Matrix6 Q_inv = poses_[1].motion->information();
  const Eigen::Matrix<double, 12, 12> H = J.transpose() * Q_inv * J;
  const Eigen::Matrix<double, 12, 1> h =
      -J.transpose() * (Q_inv * (error.e - error.J_prev * blanket.d.head<6>()));
  MatrixX& Lambda = blanket.Lambda;
  Lambda.topLeftCorner<6, 6>() += H.topLeftCorner<6, 6>();
  Lambda.topRightCorner<6, 6>() += H.topRightCorner<6, 6>();
  Lambda.bottomLeftCorner<6, 6>() += H.bottomLeftCorner<6, 6>();
  Lambda.bottomRightCorner<6, 6>() += H.bottomRightCorner<6, 6>();
  blanket.g.head<6>() += h.head<6>();
  blanket.g.tail<6>() += h.tail<6>();
}

/// Of what is left after elimination; what was in the old prior keeps its first estimate.
void SlidingWindowFilter::make_prior(Blanket& blanket) {
  FilterPrior next;
  next.information = std::move(blanket.Lambda);
  next.vector = std::move(blanket.g);
  next.T_lin = poses_[1].T_c_l;
  for (const int l : blanket.kept) {
    const auto i = static_cast<std::size_t>(l);
    const bool known = first_estimates() && l < prior_.landmark_count();
    next.landmarks_lin.push_back(known ? prior_.landmarks_lin[i] : points_[i]);
  }
  if (first_estimates()) next.fit_frame();
  prior_ = std::move(next);
}

void SlidingWindowFilter::marginalise_oldest(const std::vector<bool>& drop) {
  if (!first_estimates()) prior_.relinearise(points_, poses_.front().T_c_l);
  Blanket blanket = blanket_of_oldest(drop);
  add_prior(blanket);
  add_measurements(blanket);
  add_motion(blanket);
  auto& [kept, rest, at, eliminated, Lambda, g, d] = blanket;
  if (oldest_fixed_) {  // known: conditioning on it is dropping it
    Lambda.topRows<6>().setZero();
    Lambda.leftCols<6>().setZero();
    Lambda.topLeftCorner<6, 6>().setIdentity();
    g.head<6>().setZero();
  }
  // Eliminated at the current estimate, where the slope of what is left does not depend on which part of the
  // fill-in is kept: removing a pose never moves the estimate, in the sparse filters either (eq. 12).
  g.noalias() -= Lambda * d;
  schur_marginalise(Lambda, g, eliminated,
                    options_.removal == PoseRemoval::kMarginalise ? FillIn::kFull : FillIn::kBlockDiagonal,
                    fill_in_blocks(kept.size()));
  g.noalias() += Lambda * d.tail(g.size());
  make_prior(blanket);
  oldest_fixed_ = false;
  poses_.pop_front();
  poses_.front().motion.reset();
  kept.insert(kept.end(), rest.begin(), rest.end());
  compact_landmarks(kept);
}

void SlidingWindowFilter::compact_landmarks(const std::vector<int>& order) {
  std::vector<int> moved(landmarks_.size(), -1);
  std::vector<LandmarkRecord> records;
  std::vector<Vector3> points;
  std::vector<std::int64_t> ids;
  for (const int old : order) {
    const auto i = static_cast<std::size_t>(old);
    moved[i] = static_cast<int>(points.size());
    records.push_back(landmarks_[i]);
    points.push_back(points_[i]);
    ids.push_back(ids_[i]);
  }
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if (moved[i] < 0) {
      index_.erase(ids_[i]);
    } else {
      index_[ids_[i]] = moved[i];
    }
  }
  for (Pose& pose : poses_) {
    for (Observation& o : pose.observations) o.landmark = moved[static_cast<std::size_t>(o.landmark)];
  }
  landmarks_ = std::move(records);
  points_ = std::move(points);
  ids_ = std::move(ids);
}

}  // namespace twofold
