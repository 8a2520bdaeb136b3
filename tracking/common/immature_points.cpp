#include "tracking/common/immature_points.hpp"

#include <algorithm>

#include "base/option_check.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {

std::string ImmaturePointOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_failures", max_failures, 1)
      .at_least("max_age", max_age, 0)
      .at_least("max_age_of_one_camera", max_age_of_one_camera, 0)
      .within("trusted_after", trusted_after, 0, 255)
      .at_least("moving_after", moving_after, 1)
      .reason();
}

void move_to_mid_exposure(const Rig& rig, const RollingShutter& shutter, ImmaturePoint& point) {
  if (shutter.at_rest()) return;
  Observation& seen = point.anchor_observation;
  const Vector3 x_c = shutter.T_row_c(seen.pixel.y()).inverse() * from_inverse_depth(point.psi);
  if (!in_front_of_camera(x_c)) return;
  point.psi = to_inverse_depth(x_c);
  seen.pixel = shutter.at_mid_exposure(rig, seen.pixel.cast<double>(), x_c).cast<float>();
}

const PendingKeyframe* ImmaturePoints::find_pending(KeyframeId id) const {
  const auto it = std::find_if(pending_.begin(), pending_.end(), [&](const auto& p) { return p.id == id; });
  return it != pending_.end() ? &*it : nullptr;
}

void ImmaturePoints::add_pending(const PendingKeyframe& keyframe) {
  pending_.push_back(keyframe);
  ++revision_;
}

void ImmaturePoints::clear_points() {
  points_.clear();
  ++revision_;
}

bool ImmaturePoints::add(const ImmaturePoint& point) {
  if (points_.size() == points_.capacity()) return false;
  ++revision_;
  points_.push_back(point);
  return true;
}

void ImmaturePoints::forget_mapped(const GraphSnapshot& graph) {
  ++revision_;
  std::erase_if(pending_, [&](const PendingKeyframe& keyframe) { return graph.contains(keyframe.id); });
  std::erase_if(points_, [&](const ImmaturePoint& point) {
    return point.proposed_in != kNoKeyframe && graph.contains(point.proposed_in);
  });
}

void ImmaturePoints::drop_stale(KeyframeId newest, int max_failures, int max_age) {
  ++revision_;
  std::erase_if(points_, [&](const ImmaturePoint& point) {
    if (point.proposed_in != kNoKeyframe) return false;
    const int age = static_cast<int>(index(newest)) - static_cast<int>(index(point.usable_since));
    return point.failures >= max_failures || age > max_age;
  });
}

}  // namespace twofold
