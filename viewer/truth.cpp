#include "viewer/truth.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace twofold {
namespace {

/// The median depth of one camera's first map is one: nearer than this the direction of its way is known, its
/// length hardly.
constexpr double kLeastWay = 0.05;

double distance(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

}  // namespace

TruthBeside::TruthBeside(std::vector<Pose> truth, std::vector<std::int64_t> t_ns, bool scaled)
    : truth_(std::move(truth)), t_ns_(std::move(t_ns)), scaled_(scaled) {}

std::optional<ViewTruth> TruthBeside::add(const TrackedPose& tracked) {
  if (truth_.empty() || truth_.size() != t_ns_.size()) return std::nullopt;
  const bool is_first = !first_;
  if (is_first) first_ = tracked;
  if (!scaled_) return is_first ? std::optional(lay(1)) : std::nullopt;
  const auto scale = find_scale(tracked);
  return scale ? std::optional(lay(*scale)) : std::nullopt;
}

const Pose& TruthBeside::true_pose(std::int64_t t_ns) const {
  auto nearest = std::lower_bound(t_ns_.begin(), t_ns_.end(), t_ns);
  const bool before_is_nearer =
      nearest != t_ns_.begin() && (nearest == t_ns_.end() || t_ns - *std::prev(nearest) < *nearest - t_ns);
  if (before_is_nearer) --nearest;
  return truth_[static_cast<std::size_t>(nearest - t_ns_.begin())];
}

std::optional<double> TruthBeside::find_scale(const TrackedPose& tracked) {
  if (tracked.part != first_->part) return std::nullopt;
  const double way = distance(tracked.T_world_camera.t, first_->T_world_camera.t);
  const double true_way = distance(true_pose(tracked.t_ns).t, true_pose(first_->t_ns).t);
  if (way < std::max(kLeastWay, 1.5 * farthest_) || true_way == 0) return std::nullopt;
  farthest_ = way;
  return way / true_way;
}

ViewTruth TruthBeside::lay(double scale) const {
  constexpr std::size_t kMost = 4096;
  const Pose T_camera_truth = inverse(true_pose(first_->t_ns));
  ViewTruth shown{first_->part, scale, {}};
  for (std::size_t i = 0; i < truth_.size(); i += truth_.size() / kMost + 1) {
    auto p = transform(T_camera_truth, truth_[i].t);
    for (double& coordinate : p) coordinate *= scale;
    p = transform(first_->T_world_camera, p);
    const double t = 1e-9 * static_cast<double>(t_ns_[i] - first_->t_ns);
    shown.path.push_back({float(t), float(p[0]), float(p[1]), float(p[2])});
  }
  return shown;
}

}  // namespace twofold
