// From where the camera should be to where it is: points that should be visible, where they are found, and
// the pose that fits.
#include <algorithm>
#include <cmath>
#include <span>

#include "base/median.hpp"
#include "geometry/symmetric_solve.hpp"
#include "imaging/view_change.hpp"
#include "tracking/tracker.hpp"

namespace twofold {
namespace {

constexpr int kShutterRounds = 3;
constexpr std::size_t kFewestInLight = 15;  // points that say by how much the light changed
/// Cameras either read all rows at once or take up to a frame's period: while nobody knows [s].
constexpr double kUnknownReadout = 0.015;

}  // namespace

/// From the dense alignment's pose; where few points are found from there, and it is not where the camera
/// would be had it gone on, from the latter, too. Dense alignment follows what has most gradient, which may
/// be what moves itself, a train or the camera's own shadow: the map's points at rest are then not even
/// searched where they are.
LostCause Tracker::search_from_either(const SearchStart& aligned, FrameStep& step) {
  const LostCause cause = search_from(aligned, step);
  const bool placed = cause == LostCause::kNone;
  const bool settled =
      placed && step.result.matches >= options_.settled_searched_share * step.result.searched;
  if (settled || !leaves_motion(aligned.placement.T_c_ref)) return cause;
  const int inliers = placed ? step.result.inliers : 0;
  const SearchStart going_on{.placement = {last_.reference, predicted_pose()}, .rough = false};
  const LostCause other = search_from(going_on, step);
  const bool enough = placed || well_supported(step.result);
  if (other == LostCause::kNone && step.result.inliers > inliers && enough) return other;
  return search_from(aligned, step);
}

/// The pose is further from where the camera would be had it gone on, as the last frame's points show, than
/// points are searched.
bool Tracker::leaves_motion(const SE3& T_c_ref) {
  if (loss_.lost_frames() > 0 || !last_velocity_) return false;
  const SE3 T_cur_prev = T_c_ref * last_.T_c_ref.inverse();
  samples_.clear();
  for (const AlignmentPoint& point : previous_points_) {
    const Vector3 here = T_cur_prev * point.x, there = T_cur_prev_ * point.x;
    if (std::min(here.z(), there.z()) <= 0) continue;
    samples_.push_back((rig_.camera.project(here) - rig_.camera.project(there)).norm());
  }
  return !samples_.empty() && median(std::span(samples_)) > options_.search.radius_px;
}

/// Points that should be visible  (thesis 6.2.5), into the quadtree.
void Tracker::select_candidates(const SE3& T_c_ref, TrackResult& result) {
  quadtree_.clear();
  std::size_t reference_points_in_view = 0;
  const Matrix3 R_c_ref = T_c_ref.rotation();
  const auto points = local_map_.points();
  const auto [reference_begin, reference_end] = local_map_.reference_range();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3 x_c = R_c_ref * points[i].x_ref + T_c_ref.translation();
    const auto uv = rig_.camera.find_in_view(x_c, options_.border_px);
    if (!uv) continue;
    const SE3& T_ref_a = local_map_.T_ref_a(points[i]);
    const Vector3 from_anchor = points[i].x_ref - T_ref_a.translation();
    const Vector3 from_here = R_c_ref.transpose() * x_c;
    if (ViewChange::between(from_anchor, from_here).cosine < options_.min_view_cosine) continue;
    if (i >= reference_begin && i < reference_end) ++reference_points_in_view;
    quadtree_.insert(uv->cast<float>(), static_cast<std::uint32_t>(i));
  }
  result.candidates = static_cast<int>(quadtree_.size());
  const auto reference_points = static_cast<double>(reference_end - reference_begin);
  result.reference_in_view =
      reference_points > 0 ? static_cast<double>(reference_points_in_view) / reference_points : 0.0;
}

/// Guided search in equi-distributed order (thesis 3.4.3) until enough points were found.
void Tracker::search_points(const SE3& T_c_ref, double radius_px, FrameStep& step) {
  TrackResult& result = step.result;
  matches_.clear();
  missed_.clear();
  result.searched = 0;
  result.T_c_ref_predicted = T_c_ref;
  result.search_radius_px = radius_px;
  GuidedSearchOptions search = options_.search;
  search.refine_iterations = step.bounds.refine_iterations;
  search.radius_px = radius_px;
  for (std::int64_t i = quadtree_.next(); i >= 0; i = quadtree_.next()) {
    if (static_cast<int>(matches_.size()) >= step.bounds.wanted_matches ||
        result.searched >= step.bounds.max_searches) {
      break;
    }
    ++result.searched;
    if (!search_point(static_cast<std::uint32_t>(i), T_c_ref, search, step))
      missed_.push_back(static_cast<std::uint32_t>(i));
  }
  search_in_other_light(T_c_ref, search, step);
  count_misses();
  result.matches = static_cast<int>(matches_.size());
}

/// @param point  position in local_map_.points()
bool Tracker::search_point(std::uint32_t point, const SE3& T_c_ref, const GuidedSearchOptions& search,
                           const FrameStep& step) {
  const TrackedPoint& tracked = local_map_.points()[point];
  const SE3 T_c_a = step.shutter.seen_from(rig_, T_c_ref, tracked.x_ref) * local_map_.T_ref_a(tracked);
  const auto found = find_point(current_, rig_, *tracked.appearance, tracked.psi, T_c_a, search);
  if (!found) return false;
  if (ImmaturePoint* young = immature_point(tracked)) young->failures = 0;
  matches_.push_back({point, *found});
  return true;
}

void Tracker::count_misses() {
  for (const std::uint32_t i : missed_) {
    ImmaturePoint* young = immature_point(local_map_.points()[i]);
    if (young == nullptr) continue;
    young->failures = static_cast<std::uint8_t>(std::min(young->failures + 1, 255));
    young->agreed = 0;
  }
}

/// Where many points were missed and the view is brighter or darker there than their patches are, the light
/// has changed, and they are looked for as they look in it. Patches are not made as bright as the view one by
/// one: before another surface than theirs that would make them look alike.
void Tracker::search_in_other_light(const SE3& T_c_ref, GuidedSearchOptions search, const FrameStep& step) {
  if (static_cast<double>(missed_.size()) < options_.light_missed_share * step.result.searched) return;
  samples_.clear();
  for (const std::uint32_t i : missed_) {
    const TrackedPoint& point = local_map_.points()[i];
    const SE3 T_c_a = T_c_ref * local_map_.T_ref_a(point);
    const auto ratio =
        brightness_since_anchor(current_.left, rig_.camera, *point.appearance, point.psi, T_c_a);
    if (ratio) samples_.push_back(*ratio);
  }
  if (samples_.size() < kFewestInLight) return;
  const double gain = median(std::span(samples_));
  if (std::max(gain, 1 / gain) < options_.light_change) return;
  search.gain = static_cast<float>(gain);
  std::erase_if(missed_, [&](std::uint32_t i) { return search_point(i, T_c_ref, search, step); });
}

/// The camera's motion in this frame, if it is at T_c_ref: that since the last one goes on. None after a
/// loss.
std::optional<Vector6> Tracker::velocity_at(const SE3& T_c_ref, const Frame& frame) const {
  const double seconds = static_cast<double>(frame.t_ns - last_t_ns_) * 1e-9;
  if (loss_.lost_frames() > 0 || !(seconds > 0)) return std::nullopt;
  return (T_c_ref * last_.T_c_ref.inverse()).log() / seconds;
}

RollingShutter Tracker::shutter_at(const SE3& T_c_ref, const Frame& frame) const {
  if (rig_.readout.value_or(0) == 0) return {};
  const auto velocity = velocity_at(T_c_ref, frame);
  return velocity ? RollingShutter(rig_, *velocity) : RollingShutter();
}

/// From what was found in this frame and the ones before, whether it fitted the map or not.
void Tracker::learn_readout(const FrameStep& step, bool goes_on) {
  if (!goes_on) readout_->interrupt();
  std::vector<ReadoutPoint>* seen = readout_->begin_frame(step.frame.t_ns, T_cur_prev_);
  if (seen == nullptr) return;
  for (const Match& match : matches_) {
    const TrackedPoint& point = local_map_.points()[match.point];
    const Vector3& z = match.found.z;
    const bool measured = rig_.kind != SensorKind::kMono && z.x() > z.z();
    const double depth =
        measured ? rig_.depth_from_disparity(z.x() - z.z()) : (step.result.T_c_ref * point.x_ref).z();
    // By where it was seen first, which it keeps when the map takes it over.
    const Eigen::Vector2f& uv = point.appearance->uv;
    const std::uint64_t key = std::uint64_t{index(local_map_.anchor(point))} << 32U |
                              std::uint64_t(2 * uv.x() + 1) << 16U | std::uint64_t(2 * uv.y() + 1);
    seen->push_back({key, z.head<2>(), depth, std::ldexp(rig_.noise.sigma_px, match.found.level)});
  }
  readout_->end_frame();
  if (readout_->estimate().significant) rig_.readout = readout_->estimate().seconds;
}

/// What was found, as a global shutter would have seen it.
void Tracker::observe_matches(const SE3& T_c_ref, const RollingShutter& shutter) {
  motion_.clear();
  for (const Match& match : matches_) {
    const Vector3& x_ref = local_map_.points()[match.point].x_ref;
    const Eigen::Vector3f z = shutter.at_mid_exposure(rig_, match.found.z, T_c_ref * x_ref).cast<float>();
    motion_.push_back({x_ref, z, rig_.information(z, match.found.level)});
  }
}

/// What was found lately must not take the camera along if it moves itself. Keeps account of which of the
/// tracker's own points are where they should be.
/// @return how many of them move
int Tracker::ask_elders(MotionOnlyResult& motion, const MotionOnlyOptions& solver) {
  anchors_.clear();
  for (const Match& match : matches_) {
    anchors_.push_back(local_map_.anchor(local_map_.points()[match.point]));
  }
  const auto overruled = elder_vote_.overrule(motion_, anchors_, motion, solver);
  if (overruled) motion = *overruled;
  int moving = 0;
  for (std::size_t m = 0; m < matches_.size(); ++m) {
    ImmaturePoint* young = immature_point(local_map_.points()[matches_[m].point]);
    if (young == nullptr) continue;
    const int agreed = motion_[m].inlier ? std::min(young->agreed + 1, 255) : 0;
    young->agreed = static_cast<std::uint8_t>(agreed);
    young->moved = static_cast<std::uint8_t>(motion_[m].inlier ? 0 : std::min(young->moved + 1, 255));
    const bool expelled = overruled && agreed == 0;  // found, but it is something that moves
    if (expelled) young->failures = 255;
    moving += expelled || young->moved >= options_.moving_after ? 1 : 0;
  }
  return moving;
}

/// Motion-only bundle adjustment  (eq. 3.34), and whether its result can be trusted. Where rows are read one
/// after the other, how they move is known by the result only: a few rounds.
LostCause Tracker::estimate_pose(const Placement& start, FrameStep& step) {
  TrackResult& result = step.result;
  MotionOnlyOptions solver = options_.motion;
  solver.max_iterations = step.bounds.motion_iterations;
  MotionOnlyResult motion;
  motion.T_c_ref = start.T_c_ref;
  const int rounds = step.shutter.at_rest() ? 1 : kShutterRounds;
  for (int round = 0; round < rounds; ++round) {
    observe_matches(motion.T_c_ref, step.shutter);
    motion = optimise_motion(rig_, motion_, motion.T_c_ref, solver);
    if (rounds > 1) step.shutter = shutter_at(motion.T_c_ref, step.frame);
  }
  result.moving = ask_elders(motion, solver);
  result.inliers = motion.inliers;
  if (result.candidates < options_.min_inliers) return LostCause::kTooFewCandidates;
  if (result.matches < options_.min_inliers) return LostCause::kTooFewMatches;
  if (motion.inliers < options_.min_inliers || motion.inliers < options_.min_inlier_share * result.matches) {
    return LostCause::kInconsistentMatches;
  }
  result.status = TrackStatus::kTracking;
  result.reference = start.reference;
  result.T_c_ref = motion.T_c_ref;
  result.information = honest_information(motion, solver, step);
  return LostCause::kNone;
}

/// By how much the readout that frames are tracked with may be wrong [s]; 0 where the calibration has it.
double Tracker::readout_sigma() const {
  if (!readout_) return 0;
  const ReadoutEstimate& estimate = readout_->estimate();
  const double prior = kUnknownReadout * kUnknownReadout;
  const double trust = prior / (prior + estimate.sigma * estimate.sigma);  // 0 before the first pair
  const double unused = rig_.readout ? 0 : trust * estimate.seconds;
  return std::hypot(std::sqrt(prior * (1 - trust)), unused);
}

/// What a rolling shutter adds to the covariance. Its readout is known with an error, if at all; and the
/// motion within a frame is taken to be that since the frame before, which is wrong by half of what the
/// motion changed by, or by all of it where the frame before knew none.
/// @param by_rows  RegionSums::by_rows of the measurements that `information` is of
Matrix6 Tracker::shutter_covariance(const Matrix6& information, const Matrix6& by_rows,
                                    const FrameStep& step) const {
  Matrix6 covariance = Matrix6::Zero();
  const auto velocity = velocity_at(step.result.T_c_ref, step.frame);
  if (!velocity || step.result.reference != last_.reference) return covariance;
  const Vector6 change = last_velocity_ ? 0.5 * (*velocity - *last_velocity_) : *velocity;
  for (const Vector6& bent :
       {Vector6(readout_sigma() * *velocity), Vector6(rig_.readout.value_or(0) * change)}) {
    if (bent.isZero(0)) continue;
    const Vector6 pushed = solve_symmetric(information, by_rows * bent);
    covariance += 2 * pushed * pushed.transpose();  // the reference keyframe moved as well, and alike
  }
  return covariance;
}

/// What is known of the pose relative to the reference keyframe, as the residuals say.
Matrix6 Tracker::honest_information(const MotionOnlyResult& motion, const MotionOnlyOptions& solver,
                                    const FrameStep& step) {
  // A pose that elders alone give is not the one that all points agree on.
  const bool all_agree = !elder_vote_.mistrusts_the_young();
  uncertainty_.update(motion_, motion, solver, all_agree);
  const auto difference = elder_vote_.difference();
  if (all_agree && difference) uncertainty_.add_split(*difference);
  const Matrix6 covariance = uncertainty_.covariance(motion.information) +
                             shutter_covariance(motion.information, uncertainty_.by_rows(), step);
  const Matrix6 information = inverse_symmetric(covariance);
  return information.allFinite() ? information : motion.information / uncertainty_.variance_factor();
}

/// Inliers whose depths several keyframes know.
int Tracker::mapped_inliers() const {
  int count = 0;
  for (std::size_t m = 0; m < matches_.size(); ++m) {
    count += motion_[m].inlier && local_map_.points()[matches_[m].point].immature < 0 ? 1 : 0;
  }
  return count;
}

/// A pose from a rough start is believed when the map's points are found where they should be seen from
/// there: from a wrong one some are found as well, but few agree. Few points that were measured from one
/// place only all agree, and are all wrong by their depths' errors.
bool Tracker::well_supported(const TrackResult& result) const {
  return (result.inliers >= options_.rough_min_inliers || mapped_inliers() >= options_.rough_min_mapped) &&
         result.inliers >= options_.rough_inlier_share * result.matches &&
         result.inliers >= options_.rough_searched_share * result.searched;
}

}  // namespace twofold
