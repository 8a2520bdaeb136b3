#include "experiments/scale_drift/exploration.hpp"

#include <algorithm>
#include <limits>
#include <map>

#include "estimation/motion_only.hpp"
#include "geometry/inverse_depth.hpp"
#include "geometry/triangulation.hpp"

namespace twofold::bench {
namespace {

constexpr std::size_t kMinPlacing = 8;  ///< known points that place a frame

class Explorer {
 public:
  Explorer(const Rig& rig, const ExplorationOptions& options) : rig_(rig), options_(options) {
    rig_.noise.sigma_px = 1;  // whatever the images': all points weigh alike
    solver_options_.max_iterations = options.iterations;
    solver_options_.huber_sigmas = options.huber_sigmas;
    solver_options_.relative_decrease = 1e-5;
  }

  /// Continues the tracks of the frame before, starts others.
  void add_sightings(const std::vector<Sighting>& sightings) {
    std::map<int, int> active;
    result_.seen.emplace_back();
    for (const Sighting& s : sightings) {
      const auto before = active_.find(s.point);
      int track = static_cast<int>(result_.tracks.size());
      if (before != active_.end()) {
        track = before->second;
      } else {
        result_.tracks.push_back({.point = s.point, .first_frame = frame_count() - 1, .uv = {}});
      }
      at(track).uv.push_back(s.uv);
      active.emplace(s.point, track);
      result_.seen.back().push_back(track);
    }
    active_ = std::move(active);
  }

  /// The first two frames at their given poses: their points, then the window.
  void bootstrap(const SE3& T_first, const SE3& T_second) {
    result_.T_c_w = {T_first, T_second};
    for (const int t : result_.seen.back()) triangulate(t, {0, 1});
    adjust();
  }

  /// One further frame: its pose, its new points, the window.
  bool step() {
    const int k = frame_count() - 1;
    const SE3 T_predicted = pose(k - 1) * pose(k - 2).inverse() * pose(k - 1);  // start value only
    result_.T_c_w.push_back(T_predicted);
    place(k, T_predicted);
    for (const int t : result_.seen.back()) {
      if (!at(t).x_w) triangulate(t, {at(t).first_frame, k});
    }
    adjust();
    return pose(k).log().allFinite() && !problem_.observations.empty();
  }

  ExplorationResult take() { return std::move(result_); }

 private:
  [[nodiscard]] int frame_count() const { return static_cast<int>(result_.seen.size()); }
  Track& at(int track) { return result_.tracks[static_cast<std::size_t>(track)]; }
  SE3& pose(int frame) { return result_.T_c_w[static_cast<std::size_t>(frame)]; }
  const Vector2& uv(const Track& track, int frame) const {
    return track.uv[static_cast<std::size_t>(frame - track.first_frame)];
  }
  StereoPixelF pixel(const Track& track, int frame) const {
    const Eigen::Vector2f at = uv(track, frame).cast<float>();
    return {at.x(), at.y(), static_cast<float>(Rig::kNoRight)};
  }

  /// Motion-only bundle adjustment of frame k  (eq. 3.34). Where too few points are known it stays where the
  /// motion goes on: the window's adjustment, which has the points seen twice too, starts from there.
  void place(int k, const SE3& T_start) {
    std::vector<MotionObservation> observations;
    for (const int t : result_.seen[static_cast<std::size_t>(k)]) {
      if (!at(t).x_w) continue;
      observations.push_back(observe_point(rig_, *at(t).x_w, pixel(at(t), k), 0));
    }
    MotionOnlyOptions options;
    options.rounds = 1;
    options.huber_sigmas = 10;  // points seen twice only may be far off
    const MotionOnlyResult placed = optimise_motion(rig_, observations, T_start, options);
    const bool usable = observations.size() >= kMinPlacing && placed.T_c_ref.log().allFinite();
    pose(k) = usable ? placed.T_c_ref : T_start;
  }

  /// A point from the two frames, if they see it under enough parallax.
  void triangulate(int t, std::pair<int, int> frames) {
    const auto [a, b] = frames;
    Track& track = at(t);
    if (track.first_frame > a || a == b) return;
    const auto x_a = triangulate_midpoint(rig_.camera.unproject(uv(track, a)).normalized(),
                                          rig_.camera.unproject(uv(track, b)).normalized(),
                                          pose(a) * pose(b).inverse(), options_.min_parallax);
    if (x_a) track.x_w = pose(a).inverse() * *x_a;
  }

  /// Bundle adjustment of the window; its first two frames are fixed, their baseline hands the scale on
  /// (thesis 3.3.3).
  void adjust() {
    const int end = static_cast<int>(result_.T_c_w.size());
    const int begin = std::max(0, end - options_.window);
    problem_.rig = rig_;
    problem_.poses.clear();
    for (int k = begin; k < end; ++k) problem_.poses.push_back({pose(k), k < begin + 2});
    problem_.points.clear();
    problem_.observations.clear();
    in_window_.clear();
    for (int k = begin; k < end; ++k) {
      for (const int t : result_.seen[static_cast<std::size_t>(k)]) {
        if (std::max(begin, at(t).first_frame) == k) add_to_window(t, begin, end);
      }
    }
    solver_.solve(problem_, solver_options_);
    for (int k = begin; k < end; ++k) pose(k) = problem_.poses[static_cast<std::size_t>(k - begin)].T_k_w;
    for (std::size_t i = 0; i < in_window_.size(); ++i) {
      const WindowProblem::Point& point = problem_.points[i];
      at(in_window_[i]).x_w = pose(begin + point.anchor).inverse() * from_inverse_depth(point.psi);
    }
  }

  /// Points with at least two sightings in [begin, end), anchored in the first of them.
  void add_to_window(int t, int begin, int end) {
    const Track& track = at(t);
    const int first = std::max(begin, track.first_frame);
    const int last = std::min(end - 1, track.last_frame());
    if (!track.x_w || last == first) return;
    WindowProblem::Point point;
    point.anchor = first - begin;
    point.psi = to_inverse_depth(pose(first) * *track.x_w);
    point.first_observation = static_cast<int>(problem_.observations.size());
    point.observation_count = last - first + 1;
    for (int k = first; k <= last; ++k) {
      if (!((pose(k) * *track.x_w).z() > 0.05)) {  // behind a camera: no linearisation there
        problem_.observations.resize(static_cast<std::size_t>(point.first_observation));
        return;
      }
      const StereoPixelF z = pixel(track, k);
      problem_.observations.push_back({k - begin, z, rig_.information(z, 0)});
    }
    problem_.points.push_back(point);
    in_window_.push_back(t);
  }

  Rig rig_;
  ExplorationOptions options_;
  WindowSolverOptions solver_options_;
  WindowSolver solver_;
  WindowProblem problem_;
  std::vector<int> in_window_;  ///< track of each point of the problem
  std::map<int, int> active_;   ///< tracks of the present frame by point of the scene
  ExplorationResult result_;
};

}  // namespace

std::optional<ExplorationResult> explore(const Rig& rig, const std::vector<std::vector<Sighting>>& frames,
                                         const SE3& T_first, const SE3& T_second,
                                         const ExplorationOptions& options) {
  Explorer explorer(rig, options);
  if (frames.size() < 2) return std::nullopt;
  explorer.add_sightings(frames[0]);
  explorer.add_sightings(frames[1]);
  explorer.bootstrap(T_first, T_second);
  for (std::size_t k = 2; k < frames.size(); ++k) {
    explorer.add_sightings(frames[k]);
    if (!explorer.step()) return std::nullopt;
  }
  return explorer.take();
}

}  // namespace twofold::bench
