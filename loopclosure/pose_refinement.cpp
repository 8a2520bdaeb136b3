#include "loopclosure/pose_refinement.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "graph/point_covariance.hpp"
#include "imaging/guided_search.hpp"

namespace twofold {

RefinementOutcome PoseRefinement::refine(const GraphSnapshot& graph, KeyframeId place,
                                         const FrameImages& images, const SE3& T_c_k, RefinedPlace& result) {
  collect_points(graph, place, T_c_k);
  if (static_cast<int>(visible_.size()) < options_.min_visible) return RefinementOutcome::kTooFewPoints;
  result.T_c_k = T_c_k;
  for (const double radius_px : {options_.radius_px, options_.second_radius_px}) {
    search(graph, place, images, result.T_c_k, radius_px);
    const MotionOnlyResult motion = optimise_motion(rig_, found_, result.T_c_k, options_.solver);
    result.inliers = motion.inliers;
    if (!motion.converged || motion.inliers < options_.min_inliers) return RefinementOutcome::kContradicted;
    result.T_c_k = motion.T_c_ref;
    result.sigma = std::sqrt(motion.information.inverse().topLeftCorner<3, 3>().trace());
  }
  result.weight = weight_of_inliers();
  const bool agreed = result.inliers >= options_.min_inlier_share * static_cast<double>(found_.size()) &&
                      result.inliers >= options_.min_visible_share * static_cast<double>(visible_.size());
  return agreed ? RefinementOutcome::kRefined : RefinementOutcome::kContradicted;
}

/// Points of the place's neighbourhood N1 that should be visible.
void PoseRefinement::collect_points(const GraphSnapshot& graph, KeyframeId place, const SE3& T_c_k) {
  keyframes_.clear();
  visible_.clear();
  direct_neighbours(graph, place, static_cast<std::size_t>(options_.neighbours), keyframes_);
  visible_points(graph, keyframes_, visited_, visible_);
  const SE3 T_c_w = T_c_k * graph.T_k_w(place);
  std::erase_if(visible_, [&](PointId id) {
    return !rig_.camera.find_in_view(T_c_w * graph.position(id), options_.border_px);
  });
  const auto most = static_cast<std::size_t>(options_.max_points);
  if (visible_.size() > most) visible_.resize(most);
}

void PoseRefinement::search(const GraphSnapshot& graph, KeyframeId place, const FrameImages& images,
                            const SE3& T_c_k, double radius_px) {
  GuidedSearchOptions options;
  options.radius_px = radius_px;
  found_.clear();
  known_.clear();
  const SE3 T_k_w = graph.T_k_w(place);
  for (const PointId id : visible_) {
    const MapPoint& point = graph.point(id);
    const SE3 T_c_a = T_c_k * T_k_w * graph.T_k_w(point.anchor).inverse();
    const auto match = find_point(images, rig_, *point.appearance, point.psi, T_c_a, options);
    if (!match) continue;
    MotionObservation& found = found_.emplace_back(
        observe_point(rig_, T_k_w * graph.position(id), match->pixel.cast<float>(), match->level));
    const Eigen::Vector3f of_pixels = found.information;
    const Eigen::Vector3f left = found.information = information(graph, id, T_c_k * T_k_w, of_pixels);
    known_.push_back(std::min(1.0f, left.x() / of_pixels.x() + left.y() / of_pixels.y()));
  }
}

Eigen::Vector3f PoseRefinement::information(const GraphSnapshot& graph, PointId id, const SE3& T_c_w,
                                            const Eigen::Vector3f& of_pixels) const {
  const auto P_w = point_covariance(rig_, graph, id);
  if (!P_w) return of_pixels;
  const Matrix3 J = rig_.project_jacobian(T_c_w * graph.position(id)) * T_c_w.rotation();
  const Eigen::Array3f of_position = (J * *P_w * J.transpose()).diagonal().cast<float>();
  return of_pixels.array() / (1 + of_pixels.array() * of_position);
}

int PoseRefinement::weight_of_inliers() const {
  double sum = 0;
  for (std::size_t i = 0; i < found_.size(); ++i) sum += found_[i].inlier ? known_[i] : 0.0;
  return std::max(1, static_cast<int>(std::lround(sum)));
}

}  // namespace twofold
