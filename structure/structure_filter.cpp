#include "structure/structure_filter.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "camera/measurement.hpp"
#include "estimation/motion_only.hpp"
#include "geometry/absolute_orientation.hpp"

namespace twofold {
namespace {

constexpr double kCornerSigma = 1;  // of corners on whole pixels, their matches' errors included [px]

/// Cells that hold a track need no other one.
class Occupancy {
 public:
  Occupancy(const PinholeCamera& camera, int cell_px)
      : cell_(cell_px),
        columns_(camera.width / cell_px + 1),
        taken_(static_cast<std::size_t>(columns_ * (camera.height / cell_px + 1))) {}

  /// False when the cell was taken already.
  bool take(const StereoPixel& z) {
    const int i = static_cast<int>(z.y()) / cell_ * columns_ + static_cast<int>(z.x()) / cell_;
    const auto cell = static_cast<std::size_t>(i);
    if (taken_[cell]) return false;
    taken_[cell] = true;
    return true;
  }

 private:
  int cell_, columns_;
  std::vector<bool> taken_;
};

}  // namespace

StructureFilter::StructureFilter(const Rig& rig, const StructureOptions& options)
    : rig_(rig), options_(options) {
  if (const std::string reason = options.invalid_reason(); !reason.empty()) {
    throw std::runtime_error("structure filter: " + reason);
  }
  if (rig.kind != SensorKind::kStereo) throw std::runtime_error("structure filter: needs a stereo rig");
}

const StructureFrame& StructureFilter::process(const Frame& frame) {
  images_.left.build(frame.left);
  images_.right.build(frame.right);
  StructureFrame report;
  report.t_ns = frame.t_ns;
  const std::vector<StereoFeature> features = find_stereo_features(images_, rig_, options_);
  SE3 T_c_w = frames_.empty() ? SE3() : frames_.back().T_c_w;
  if (!frames_.empty()) {
    // Without a motion the camera is taken to stand still; the landmarks tell whether it did.
    const auto T_cur_prev = estimate_motion(features, report);
    if (T_cur_prev) T_c_w = *T_cur_prev * T_c_w;
  }
  std::vector<SurfaceTrack> found = measure_tracks(T_c_w);
  report.measured = static_cast<int>(found.size());
  report.tracked = frames_.empty() || report.measured >= options_.min_matches;
  if (!filter_ || !report.tracked) {
    found.clear();
    start_filter(T_c_w);
  }
  tracks_ = std::move(found);
  report.T_c_w = T_c_w;
  frames_.push_back(report);
  const int found_again = static_cast<int>(tracks_.size());
  start_tracks(features, frames_.back());
  update(frames_.back(), found_again);
  give_up_outliers();
  take_estimates();
  previous_ = features;
  return frames_.back();
}

std::optional<SE3> StructureFilter::estimate_motion(const std::vector<StereoFeature>& current,
                                                    StructureFrame& report) const {
  const std::vector<FeatureMatch> matches =
      match_features(previous_, current, options_.search_share * rig_.camera.width, options_.max_sad_ratio);
  const std::vector<FeatureMatch> consistent =
      consistent_feature_matches(previous_, current, matches, rig_, options_);
  report.matches = static_cast<int>(matches.size());
  report.consistent = static_cast<int>(consistent.size());
  if (report.consistent < options_.min_matches) return std::nullopt;
  Rig corner_rig = rig_;
  corner_rig.noise.sigma_px = kCornerSigma;
  std::vector<MotionObservation> observations;
  std::vector<Vector3> x_previous, x_current;
  for (const FeatureMatch& match : consistent) {
    const StereoPixel& z = current[static_cast<std::size_t>(match.current)].pixel;
    x_previous.push_back(rig_.unproject(previous_[static_cast<std::size_t>(match.previous)].pixel));
    x_current.push_back(rig_.unproject(z));
    observations.push_back(observe_point(corner_rig, x_previous.back(), z.cast<float>(), 0));
  }
  const auto T_start = align_rigid(x_current, x_previous);
  if (!T_start) return std::nullopt;
  const MotionOnlyResult result = optimise_motion(rig_, observations, *T_start, {});
  // Not settled to the last digit within its iterations is good enough to look for the landmarks.
  if (result.inliers < options_.min_matches) return *T_start;
  return result.T_c_ref;
}

std::vector<SurfaceTrack> StructureFilter::measure_tracks(const SE3& T_c_w) const {
  std::vector<SurfaceTrack> found;
  if (!filter_) return found;
  for (const SurfaceTrack& track : tracks_) {
    const auto x_w = filter_->find_landmark(track.id);
    if (!x_w) continue;
    const SE3& T_a_w = anchors_.at(track.anchor_frame);
    const auto z = measure_track(track, images_, rig_, T_a_w * *x_w, T_c_w * T_a_w.inverse(), options_);
    if (!z) continue;
    found.push_back(track);
    found.back().pixel = *z;
  }
  return found;
}

void StructureFilter::start_filter(const SE3& T_c_w) {
  if (filter_) ++restarts_;
  filter_.emplace(rig_, options_.filter);
  filter_->set_first_pose(T_c_w, std::nullopt);
  filter_start_ = static_cast<std::int64_t>(frames_.size());
  anchors_.clear();
}

void StructureFilter::start_tracks(const std::vector<StereoFeature>& features, StructureFrame& report) {
  Occupancy occupancy(rig_.camera, options_.cell_px);
  for (const SurfaceTrack& track : tracks_) occupancy.take(track.pixel);
  std::vector<const StereoFeature*> best;
  best.reserve(features.size());
  for (const StereoFeature& feature : features) best.push_back(&feature);
  std::stable_sort(best.begin(), best.end(),
                   [](const auto* a, const auto* b) { return a->score > b->score; });
  const auto frame = static_cast<std::int64_t>(frames_.size()) - 1;
  for (const StereoFeature* feature : best) {
    if (static_cast<int>(tracks_.size()) >= options_.features) break;
    if (!occupancy.take(feature->pixel)) continue;
    auto track = start_track(images_, feature->pixel, options_);
    if (!track) continue;
    track->id = next_id_++;
    track->anchor_frame = frame;
    StructurePoint point;
    point.first_frame = frame;
    point.first_uv = track->patch.uv;
    point.grey = static_cast<std::uint8_t>(track->patch.value[SurfacePatch::kArea / 2]);
    points_[track->id] = point;
    tracks_.push_back(*track);
    ++report.started;
  }
  if (report.started > 0) anchors_[frame] = report.T_c_w;
}

/// One time step of the filter; the first `found_again` tracks were known before this frame.
void StructureFilter::update(const StructureFrame& report, int found_again) {
  FilterFrame frame;
  frame.T_c_w_start = report.T_c_w;
  const Matrix3 information = Matrix3::Identity() / (options_.sigma_px * options_.sigma_px);
  for (const SurfaceTrack& track : tracks_)
    frame.observations.push_back({track.id, track.pixel, information});
  filter_->add(frame);
  for (int i = 0; i < options_.refinements && found_again > 0; ++i) {
    filter_->optimise(1);
    const int newest = filter_->pose_count() - 1;
    for (int t = 0; t < found_again; ++t) {
      SurfaceTrack& track = tracks_[static_cast<std::size_t>(t)];
      const auto x_w = filter_->find_landmark(track.id);
      if (!x_w) continue;
      const SE3& T_a_w = anchors_.at(track.anchor_frame);
      const SE3 T_c_a = filter_->newest_T_c_w() * T_a_w.inverse();
      const auto z = measure_track(track, images_, rig_, T_a_w * *x_w, T_c_a, options_);
      if (!z || has_right(*z) != has_right(track.pixel)) continue;
      track.pixel = *z;
      filter_->set_measurement(newest, track.id, *z);
    }
  }
  summary_ = filter_->optimise();
}

void StructureFilter::give_up_outliers() {
  const SE3& T_c_w = filter_->newest_T_c_w();
  const auto is_off = [&](const SurfaceTrack& track) {
    const auto x_w = filter_->find_landmark(track.id);
    if (!x_w) return true;
    const Vector3 x_c = T_c_w * *x_w;
    if (!in_front_of_camera(x_c)) return true;
    const Vector3 r = track.pixel - rig_.project(x_c);
    return r.head<2>().norm() > options_.max_residual_px || std::abs(r.z()) > options_.max_residual_px;
  };
  tracks_.erase(std::remove_if(tracks_.begin(), tracks_.end(), is_off), tracks_.end());
}

/// Poses of the window and landmarks with their covariances, as the filter has them now.
void StructureFilter::take_estimates() {
  frames_.back().summary = summary_;
  frames_.back().T_c_w = filter_->newest_T_c_w();
  for (int j = 0; j < filter_->pose_count(); ++j) {
    const std::int64_t frame = filter_start_ + filter_->frame_of(j);
    frames_[static_cast<std::size_t>(frame)].T_c_w_smoothed = filter_->T_c_w(j);
    if (const auto anchor = anchors_.find(frame); anchor != anchors_.end())
      anchor->second = filter_->T_c_w(j);
  }
  for (const SurfaceTrack& track : tracks_) ++points_.at(track.id).measurements;
  const auto covariances = filter_->covariances();
  for (int l = 0; l < filter_->landmark_count(); ++l) {
    StructurePoint& point = points_.at(filter_->landmark_id(l));
    point.x_w = filter_->landmark(l);
    if (covariances) point.covariance = covariances->landmarks[static_cast<std::size_t>(l)];
  }
  std::map<std::int64_t, SE3> used;
  for (const SurfaceTrack& track : tracks_) used[track.anchor_frame] = anchors_.at(track.anchor_frame);
  anchors_ = std::move(used);
}

}  // namespace twofold
