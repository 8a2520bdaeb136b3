#include "loopclosure/depth_regression.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace twofold {
namespace {

constexpr std::size_t kNeighbours = 3;  // thesis 5.3.1: a surface has three points, more are of another one
constexpr double kSamePlace = 1.0;  // [px] as exactly as corners are found: distances below this weigh alike

}  // namespace

void DepthRegression::learn(const GraphSnapshot& graph, KeyframeId k) {
  samples_.clear();
  const Keyframe& keyframe = graph.keyframe(k);
  for (const Observation& observation : *keyframe.observations) {
    // Where it should be, not where it was measured: a map may have been made with another camera.
    const Vector3 x_k = keyframe.T_k_w * graph.position(observation.point);
    if (in_front_of_camera(x_k)) samples_.push_back({camera_.project(x_k), 1 / x_k.z()});
  }
  std::stable_sort(samples_.begin(), samples_.end(),
                   [](const Sample& a, const Sample& b) { return a.uv.y() < b.uv.y(); });
}

std::optional<double> DepthRegression::depth_at(const Vector2& uv) const {
  struct Neighbour {
    double distance = std::numeric_limits<double>::infinity();
    double inverse_depth = 0;
  };
  std::array<Neighbour, kNeighbours> nearest;
  const double reach = options_.max_distance_share * camera_.width;
  const auto above = [](const Sample& sample, double v) { return sample.uv.y() < v; };
  for (auto sample = std::lower_bound(samples_.begin(), samples_.end(), uv.y() - reach, above);
       sample != samples_.end() && sample->uv.y() <= uv.y() + reach; ++sample) {
    if (std::abs(sample->uv.x() - uv.x()) > reach) continue;
    const double distance = (sample->uv - uv).norm();
    if (distance >= nearest.back().distance) continue;
    nearest.back() = {distance, sample->inverse_depth};
    for (std::size_t n = kNeighbours - 1; n > 0 && nearest[n].distance < nearest[n - 1].distance; --n)
      std::swap(nearest[n], nearest[n - 1]);
  }
  double sum = 0, weights = 0;
  double least = std::numeric_limits<double>::infinity(), most = 0;
  for (const Neighbour& neighbour : nearest) {
    if (neighbour.distance > reach) break;
    const double distance = std::max(neighbour.distance, kSamePlace);
    const double weight = 1 / (distance * distance);
    sum += weight * neighbour.inverse_depth;
    weights += weight;
    least = std::min(least, neighbour.inverse_depth);
    most = std::max(most, neighbour.inverse_depth);
  }
  if (!(sum > 0) || most > options_.max_depth_ratio * least) return std::nullopt;
  return weights / sum;
}

void DepthRegression::fill(PlaceAppearance& view, double baseline) const {
  view.pixels.clear();
  for (const DescribedCorner& corner : view.corners) {
    const auto depth = depth_at(corner.uv.cast<double>());
    const double u_r = depth ? corner.uv.x() - camera_.fx * baseline / *depth : Rig::kNoRight;
    view.pixels.emplace_back(corner.uv.x(), corner.uv.y(), static_cast<float>(u_r));
  }
}

}  // namespace twofold
