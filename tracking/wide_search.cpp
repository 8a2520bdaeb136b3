#include "tracking/wide_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "imaging/patch.hpp"

namespace twofold {
namespace {

constexpr int kMargin = Patch::kSize;
constexpr int kMaxRows = 1024;
constexpr int kBeside = 3;  // rows that the least cost spreads over

struct RowBest {
  int cost = std::numeric_limits<int>::max();
  int u = 0;
};

RowBest best_in_row(const Patch& patch, const cv::Mat& image, int v, int first, int last) {
  std::array<int, kMaxRowCosts> costs;
  const int count = std::min(last - first + 1, kMaxRowCosts);
  zero_mean_ssd_row(patch, image, first, v, std::span(costs).first(static_cast<std::size_t>(count)));
  const auto* const least = std::min_element(costs.data(), costs.data() + count);
  return {*least, first + static_cast<int>(least - costs.data())};
}

}  // namespace

WideSearch::WideSearch(const Rig& rig, std::size_t capacity, const WideSearchOptions& options)
    : rig_(rig), options_(options), consensus_(rig, capacity, options.consensus) {
  found_.reserve(capacity);
}

std::optional<SE3> WideSearch::find(const ImagePyramid& previous, const FrameImages& current,
                                    std::span<const AlignmentPoint> points,
                                    const GuidedSearchOptions& search) {
  found_.clear();
  for (const AlignmentPoint& point : points.first(std::min(points.size(), found_.capacity()))) {
    const auto z = find_one(previous, current, point, search);
    if (!z || std::isnan(z->z())) continue;
    found_.push_back({point.x, z->cast<float>(), measurement_information(rig_, options_.level, true), true});
  }
  const auto rough = consensus_.find(found_, options_.min_agreeing);
  if (!rough) return std::nullopt;
  // Depths of the coarse level are poor; where the points are seen is not.
  const MotionOnlyResult refined = optimise_motion(rig_, found_, *rough, options_.refinement);
  return refined.inliers >= options_.min_agreeing ? std::optional(refined.T_c_ref) : std::nullopt;
}

/// The point's measurement in the current frame, NaN where its depth is not known.
std::optional<Vector3> WideSearch::find_one(const ImagePyramid& previous, const FrameImages& current,
                                            const AlignmentPoint& point,
                                            const GuidedSearchOptions& search) const {
  const float scale = std::ldexp(1.0F, -options_.level);
  const Eigen::Vector2f uv_level = ((point.uv.array() + 0.5F) * scale - 0.5F).matrix();
  const Eigen::Vector2i centre = uv_level.array().round().matrix().cast<int>();
  Patch patch;
  if (!cut_patch(previous.level(options_.level), centre.x(), centre.y(), patch)) return std::nullopt;
  if (patch.deviation < options_.min_deviation) return std::nullopt;
  const cv::Mat& image = current.left.level(options_.level);
  const auto place = best_place(patch, image);
  if (!place) return std::nullopt;
  const auto aligned = align_patch(patch, image, place->cast<float>(), search.refine_iterations);
  if (!aligned) return std::nullopt;
  // The patch was cut around a whole pixel: the point is off its centre by the same part of one.
  const Eigen::Vector2f uv = aligned->uv + uv_level - centre.cast<float>();
  const Vector2 z = ((uv.array() + 0.5F) / scale - 0.5F).matrix().cast<double>();
  if (rig_.kind == SensorKind::kRgbd) {
    return Vector3(z.x(), z.y(), right_from_depth(current.depth, rig_, z.x(), z.y()));
  }
  const int u = static_cast<int>(std::lround(uv.x()));
  const int v = static_cast<int>(std::lround(uv.y()));
  const double u_r = right_from_row(current, rig_, u, v, options_.level, search);
  return Vector3(z.x(), z.y(), u_r + (uv.x() - static_cast<float>(u)) / scale);
}

/// Where the patch fits best, if it fits clearly worse elsewhere.
std::optional<Eigen::Vector2i> WideSearch::best_place(const Patch& patch, const cv::Mat& image) const {
  const int first_u = kMargin;
  const int last_u = image.cols - 1 - kMargin;
  const int first_v = kMargin;
  const int last_v = std::min(image.rows - 1 - kMargin, first_v + kMaxRows - 1);
  if (first_u > last_u || first_v > last_v) return std::nullopt;
  std::array<RowBest, kMaxRows> rows;
  int best_v = first_v;
  const auto row = [&](int v) -> RowBest& { return rows[static_cast<std::size_t>(v - first_v)]; };
  for (int v = first_v; v <= last_v; ++v) {
    row(v) = best_in_row(patch, image, v, first_u, last_u);
    if (row(v).cost < row(best_v).cost) best_v = v;
  }
  const RowBest& best = row(best_v);
  for (int v = first_v; v <= last_v; ++v) {
    const bool beside = std::abs(v - best_v) <= kBeside;
    if (!beside && best.cost > options_.max_cost_ratio * row(v).cost) return std::nullopt;
  }
  return Eigen::Vector2i(best.u, best_v);
}

}  // namespace twofold
