#include "loopclosure/depth_regression.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace twofold {
namespace {

constexpr std::size_t kNeighbours = 3;  // thesis 5.3.1: a surface has three points, more are of another one
constexpr double kSamePlace = 1.0;  // [px] as exactly as corners are found: distances below this weigh alike

}  // namespace

DepthRegression::DepthRegression(const PinholeCamera& camera, const DepthRegressionOptions& options)
    : camera_(camera),
      options_(options),
      reach_(options.max_distance_share * camera.width),
      cell_(std::max(reach_, kSamePlace)),
      cells_(Eigen::Array2i(static_cast<int>(camera.width / cell_), static_cast<int>(camera.height / cell_)) +
             1) {}

/// Those beside the image are of the nearest cell.
Eigen::Array2i DepthRegression::cell_of(const Eigen::Array2d& uv) const {
  const Eigen::Array2d last = (cells_ - 1).cast<double>();
  return (uv / cell_).max(0).min(last).cast<int>();
}

void DepthRegression::learn(const GraphSnapshot& graph, KeyframeId k) {
  unsorted_.clear();
  const Keyframe& keyframe = graph.keyframe(k);
  for (const Observation& observation : *keyframe.observations) {
    // Where it should be, not where it was measured: a map may have been made with another camera.
    const Vector3 x_k = keyframe.T_k_w * graph.position(observation.point);
    if (in_front_of_camera(x_k)) unsorted_.push_back({camera_.project(x_k), 1 / x_k.z()});
  }
  const auto index_of = [&](const Sample& sample) {
    const Eigen::Array2i cell = cell_of(sample.uv.array());
    return static_cast<std::size_t>(cell.y() * cells_.x() + cell.x());
  };
  begin_.assign(static_cast<std::size_t>(cells_.prod()) + 1, 0);
  for (const Sample& sample : unsorted_) ++begin_[index_of(sample) + 1];
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  samples_.resize(unsorted_.size());
  std::vector<int> next(begin_.begin(), begin_.end() - 1);
  for (const Sample& sample : unsorted_)
    samples_[static_cast<std::size_t>(next[index_of(sample)]++)] = sample;
}

std::optional<double> DepthRegression::depth_at(const Vector2& uv) const {
  struct Neighbour {
    double distance = std::numeric_limits<double>::infinity();
    double inverse_depth = 0;
  };
  std::array<Neighbour, kNeighbours> nearest;
  const Eigen::Array2i first = cell_of(uv.array() - reach_), last = cell_of(uv.array() + reach_);
  for (int row = first.y(); row <= last.y(); ++row) {
    const auto in_row = static_cast<std::size_t>(row * cells_.x());
    const int end = begin_[in_row + static_cast<std::size_t>(last.x()) + 1];
    for (int s = begin_[in_row + static_cast<std::size_t>(first.x())]; s < end; ++s) {
      const Sample& sample = samples_[static_cast<std::size_t>(s)];
      const double distance = (sample.uv - uv).norm();
      if (distance >= nearest.back().distance) continue;
      nearest.back() = {distance, sample.inverse_depth};
      for (std::size_t n = kNeighbours - 1; n > 0 && nearest[n].distance < nearest[n - 1].distance; --n)
        std::swap(nearest[n], nearest[n - 1]);
    }
  }
  double sum = 0, weights = 0;
  double least = std::numeric_limits<double>::infinity(), most = 0;
  for (const Neighbour& neighbour : nearest) {
    if (neighbour.distance > reach_) break;
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
