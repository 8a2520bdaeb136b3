#include "tracking/monocular_start.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/median.hpp"
#include "camera/rolling_shutter.hpp"
#include "estimation/motion_only.hpp"
#include "geometry/inverse_depth.hpp"
#include "imaging/image_buffers.hpp"
#include "tracking/monocular/metric_scale.hpp"

namespace twofold {
namespace {

double median_flow(const StartCandidate& candidate) {
  std::vector<float> flow;
  for (const FollowedCorner& corner : candidate.corners)
    flow.push_back((corner.uv - corner.appearance.uv).norm());
  return median(std::span(flow));
}

NewPointOptions of_wide_steps(const Rig& rig, const TrackerOptions& options) {
  NewPointOptions more = options.new_points;
  more.max_points = options.monocular_start.wide_following.wanted;
  return with_cells_of_one_camera(rig, more);
}

}  // namespace

MonocularStart::MonocularStart(const Rig& rig, const TrackerOptions& options)
    : rig_(rig),
      options_(options),
      starter_(rig, with_cells_of_one_camera(rig, options.new_points), options.search),
      wide_starter_(rig, of_wide_steps(rig, options), options.search),
      wide_following_(rig, options.monocular_start.wide_following),
      candidates_(static_cast<std::size_t>(options.monocular_start.candidates)) {
  rig_.noise.sigma_px = options.monocular_start.first_structure.sigma_px;
  const auto corners = static_cast<std::size_t>(
      std::max(options.new_points.max_points, options.monocular_start.wide_following.wanted));
  for (StartCandidate& candidate : candidates_) {
    allocate_images(rig, candidate.images);
    candidate.corners.reserve(corners);
  }
  allocate_images(rig, last_);
  order_.reserve(candidates_.size());
  appearances_.reserve(corners);
  seen_.reserve(corners);
}

void MonocularStart::reset() {
  order_.clear();
  has_last_ = false;
}

void MonocularStart::watch(const FrameImages& images, const Frame& frame) {
  follow_all(images, frame);
  drop_unseen_candidates();
  renew_candidates(images, frame);
  remember_frame(images, frame);
}

tl::expected<MonocularStartResult, LostCause> MonocularStart::step(const FrameImages& images,
                                                                   const Frame& frame) {
  follow_all(images, frame);
  LostCause cause = LostCause::kTooLittleParallax;
  // The oldest one has seen most motion, and says what is missing.
  for (const std::size_t c : order_) {
    const auto structure = examine(candidates_[c], images);
    if (structure) return MonocularStartResult{&candidates_[c], *structure};
    if (c == order_.front()) cause = structure.error();
  }
  if (drop_unseen_candidates()) cause = LostCause::kStepsTooWide;
  renew_candidates(images, frame);
  remember_frame(images, frame);
  return tl::unexpected(candidates_[order_.front()].corners.empty() ? LostCause::kTooFewCorners : cause);
}

void MonocularStart::remember_frame(const FrameImages& images, const Frame& frame) {
  last_.left.copy_from(images.left);
  last_index_ = frame.index;
  last_t_ns_ = frame.t_ns;
  has_last_ = true;
}

void MonocularStart::follow_all(const FrameImages& images, const Frame& frame) {
  if (!has_last_) return;
  for (const std::size_t c : order_) {
    remember_place(candidates_[c]);
    remember_path(last_index_, candidates_[c]);
  }
  interval_ = 1e-9 * static_cast<double>(frame.t_ns - last_t_ns_);
  wide_following_.begin_step();
  for (const std::size_t c : order_) follow(images, candidates_[c]);
}

/// Which of a candidate's corners can be followed from the frame before, and whether those are few.
bool MonocularStart::follow_corners(const FrameImages& images, std::vector<FollowedCorner>& corners) {
  const MonocularStartOptions& options = options_.monocular_start;
  seen_.clear();
  for (FollowedCorner& corner : corners)
    seen_.push_back(follow_corner(last_.left, images.left, options.following, corner) ? 1 : 0);
  const auto followed = static_cast<double>(std::count(seen_.begin(), seen_.end(), 1));
  return followed < options.wide_following.followed_share * static_cast<double>(corners.size());
}

/// Of a wide step many corners are lost: it begins with more of them.
void MonocularStart::follow(const FrameImages& images, StartCandidate& candidate) {
  ++candidate.age;
  const bool from_first = candidate.age == 1;
  if (follow_corners(images, candidate.corners)) {
    if (from_first) {
      choose_corners(wide_starter_, candidate);
      follow_corners(images, candidate.corners);
    }
    candidate.wide = true;
  }
  if (candidate.wide) wide_following_.follow(last_.left, images.left, candidate.corners, seen_);
  if (from_first) {
    candidate.first_interval = interval_;
    candidate.first_motion.assign(candidate.corners.size(), Eigen::Vector2f::Zero());
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < candidate.corners.size(); ++i) {
    if (seen_[i] == 0) continue;
    candidate.corners[kept] = candidate.corners[i];
    candidate.first_motion[kept] =
        from_first ? candidate.corners[i].uv - candidate.corners[i].appearance.uv : candidate.first_motion[i];
    for (auto& places : candidate.between) places[kept] = places[i];
    for (PathFrame& frame : candidate.path) frame.places[kept] = frame.places[i];
    ++kept;
  }
  candidate.corners.resize(kept);
  candidate.first_motion.resize(kept);
  for (auto& places : candidate.between) places.resize(kept);
  for (PathFrame& frame : candidate.path) frame.places.resize(kept);
}

namespace {

/// Every second one goes.
template <class Frames>
void thin_out(Frames& frames) {
  for (std::size_t b = 0; 2 * b + 1 < frames.size(); ++b) std::swap(frames[b], frames[2 * b + 1]);
  frames.resize(frames.size() / 2);
}

}  // namespace

/// Of the time between two frames, the rows take so much to be read; 0 where the calibration does not say.
double MonocularStart::readout_share(double interval) const {
  return interval > 0 ? std::min(rig_.readout.value_or(0) / interval, 1.0) : 0;
}

/// Where the newest frame sees a corner, as a global shutter would have.
Vector2 MonocularStart::last_place(const FollowedCorner& corner) const {
  return followed_to_mid_exposure(rig_.camera, corner.uv.cast<double>(),
                                  corner.motion.value_or(Eigen::Vector2f::Zero()).cast<double>(),
                                  readout_share(interval_));
}

std::vector<Eigen::Vector2f> MonocularStart::last_places(const StartCandidate& candidate) const {
  std::vector<Eigen::Vector2f> places;
  places.reserve(candidate.corners.size());
  for (const FollowedCorner& corner : candidate.corners) places.push_back(last_place(corner).cast<float>());
  return places;
}

Vector2 MonocularStart::first_place(const StartCandidate& first, std::size_t corner) const {
  return followed_to_mid_exposure(rig_.camera, first.corners[corner].appearance.uv.cast<double>(),
                                  first.first_motion[corner].cast<double>(),
                                  readout_share(first.first_interval));
}

/// Every stride-th frame is one between. When they are too many, every second one goes.
void MonocularStart::remember_place(StartCandidate& candidate) const {
  if (candidate.age == 0 || candidate.age % candidate.stride != 0) return;
  auto& between = candidate.between;
  if (between.size() == static_cast<std::size_t>(options_.monocular_start.frames_between)) {
    thin_out(between);
    candidate.stride *= 2;
    if (candidate.age % candidate.stride != 0) return;
  }
  between.push_back(last_places(candidate));
}

void MonocularStart::remember_path(std::int64_t frame_index, StartCandidate& candidate) const {
  if (candidate.age == 0 || candidate.age % candidate.path_stride != 0) return;
  if (candidate.path.size() == static_cast<std::size_t>(options_.monocular_start.longest_path)) {
    thin_out(candidate.path);
    candidate.path_stride *= 2;
    if (candidate.age % candidate.path_stride != 0) return;
  }
  candidate.path.push_back({frame_index, last_places(candidate)});
}

std::vector<EarlierFrame> MonocularStart::earlier_frames(const MonocularStartResult& start) const {
  const StartCandidate& first = *start.first;
  std::vector<EarlierFrame> frames{{first.frame_index, SE3()}};
  for (const PathFrame& frame : first.path) {
    std::vector<MotionObservation> observations;
    for (std::size_t n = 0; n < start.structure.corners.size(); ++n) {
      const Eigen::Vector2f& uv = frame.places[static_cast<std::size_t>(start.structure.corners[n])];
      const StereoPixelF z(uv.x(), uv.y(), static_cast<float>(Rig::kNoRight));
      observations.push_back(observe_point(rig_, from_inverse_depth(start.structure.psi[n]), z, 0));
    }
    const MotionOnlyResult motion = optimise_motion(rig_, observations, frames.back().T_c_first, {});
    if (motion.inliers < options_.monocular_start.placed_share * static_cast<double>(observations.size()))
      continue;
    frames.push_back({frame.frame_index, motion.T_c_ref});
  }
  return frames;
}

/// By the pose of the frame before.
std::optional<Vector6> MonocularStart::velocity(const MonocularStartResult& start) const {
  const double share = readout_share(interval_);
  if (share == 0) return std::nullopt;
  std::vector<MotionObservation> observations;
  for (std::size_t n = 0; n < start.structure.corners.size(); ++n) {
    const FollowedCorner& corner = start.first->corners[static_cast<std::size_t>(start.structure.corners[n])];
    const Vector2 motion = corner.motion.value_or(Eigen::Vector2f::Zero()).cast<double>();
    const Vector2 uv =
        followed_to_mid_exposure(rig_.camera, corner.uv.cast<double>() - motion, motion, share);
    const StereoPixelF z(Vector3(uv.x(), uv.y(), Rig::kNoRight).cast<float>());
    observations.push_back(observe_point(rig_, from_inverse_depth(start.structure.psi[n]), z, 0));
  }
  const SE3& T_last_first = start.structure.T_last_first;
  const SE3 T_before_first = optimise_motion(rig_, observations, T_last_first, {}).T_c_ref;
  return (T_last_first * T_before_first.inverse()).log() / interval_;
}

tl::expected<FirstStructure, LostCause> MonocularStart::examine(const StartCandidate& candidate,
                                                                const FrameImages& images) const {
  if (candidate.between.empty()) return tl::unexpected(LostCause::kTooLittleParallax);
  const auto as_pixels = [](const std::vector<Eigen::Vector2f>& places) {
    std::vector<Vector2> pixels;
    pixels.reserve(places.size());
    for (const Eigen::Vector2f& uv : places) pixels.push_back(uv.cast<double>());
    return pixels;
  };
  CornerViews views;
  for (std::size_t i = 0; i < candidate.corners.size(); ++i) {
    const FollowedCorner& corner = candidate.corners[i];
    views.first.push_back(first_place(candidate, i));
    views.last.push_back(last_place(corner));
    if (rig_.readout) continue;
    views.first_motion.push_back(candidate.first_motion[i].cast<double>());
    views.last_motion.push_back(corner.motion.value_or(Eigen::Vector2f::Zero()).cast<double>());
  }
  for (const auto& places : candidate.between) views.between.push_back(as_pixels(places));
  auto structure = first_structure(rig_, views, options_.monocular_start.first_structure);
  if (structure && rig_.kind == SensorKind::kRgbd && !to_metres(candidate, images, *structure))
    return tl::unexpected(LostCause::kNoTexture);
  return structure;
}

/// @return false where depth does not say how long the structure's unit is
bool MonocularStart::to_metres(const StartCandidate& first, const FrameImages& images,
                               FirstStructure& structure) const {
  const auto metres = metric_scale(rig_, first.images, images, structure.T_last_first);
  if (!metres) return false;
  structure.T_last_first = {structure.T_last_first.so3(), *metres * structure.T_last_first.translation()};
  for (Vector3& psi : structure.psi) psi.z() /= *metres;
  return true;
}

/// Gives up candidates of which little is still in view.
/// @return  whether that is all of them, the newest too: it was taken where most was still in view
bool MonocularStart::drop_unseen_candidates() {
  const std::size_t dropped = std::erase_if(order_, [&](std::size_t c) {
    const StartCandidate& candidate = candidates_[c];
    const auto fewest = static_cast<std::size_t>(options_.monocular_start.min_left_share *
                                                 static_cast<double>(candidate.corners_at_first));
    return candidate.corners.size() < std::max<std::size_t>(fewest, 1);
  });
  return dropped > 0 && order_.empty();
}

/// Takes the frame as a candidate when the newest has been left behind. The oldest makes room for it.
void MonocularStart::renew_candidates(const FrameImages& images, const Frame& frame) {
  if (!order_.empty() &&
      median_flow(candidates_[order_.back()]) < options_.monocular_start.next_flow * rig_.camera.width)
    return;
  if (order_.size() == candidates_.size()) order_.erase(order_.begin());
  std::size_t free = 0;
  while (std::find(order_.begin(), order_.end(), free) != order_.end()) ++free;
  fill(candidates_[free], images, frame);
  order_.push_back(free);
}

void MonocularStart::fill(StartCandidate& candidate, const FrameImages& images, const Frame& frame) {
  candidate.frame_index = frame.index;
  candidate.t_ns = frame.t_ns;
  candidate.age = 0;
  candidate.images.left.copy_from(images.left);
  if (rig_.kind == SensorKind::kRgbd) images.depth.copyTo(candidate.images.depth);
  candidate.wide = false;
  choose_corners(starter_, candidate);
  candidate.first_motion.clear();
  candidate.between.clear();
  candidate.stride = 1;
  candidate.path.clear();
  candidate.path_stride = 1;
}

void MonocularStart::choose_corners(PointStarter& starter, StartCandidate& candidate) {
  starter.clear();
  appearances_.clear();
  starter.choose_corners(candidate.images, starter.most_points(), appearances_);
  candidate.corners.clear();
  for (const PointAppearance& appearance : appearances_) {
    candidate.corners.push_back({appearance, appearance.uv, std::nullopt});
  }
  candidate.corners_at_first = candidate.corners.size();
}

}  // namespace twofold
