#include "structure/stereo_features.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "imaging/fast_corners.hpp"
#include "imaging/guided_search.hpp"

namespace twofold {
namespace {

constexpr int kBorder = 12;               // [px] room for a patch
constexpr double kWholePixelSigma = 0.3;  // [px] of a coordinate rounded to whole pixels: 1 / sqrt(12)

int sum_of_differences(const Patch& a, const Patch& b, int mean_difference) {
  int sum = 0;
  for (int i = 0; i < Patch::kArea; ++i) sum += std::abs(a.rounded[i] - b.rounded[i] - mean_difference);
  return sum;
}

int mean_of(const Patch& patch) {
  int sum = 0;
  for (const std::int16_t value : patch.rounded) sum += value;
  return sum / Patch::kArea;
}

struct Best {
  int index = -1;
  int cost = std::numeric_limits<int>::max();
  int second = std::numeric_limits<int>::max();

  void offer(int i, int c) {
    if (c < cost) {
      second = cost;
      cost = c;
      index = i;
    } else if (c < second) {
      second = c;
    }
  }
};

}  // namespace

std::vector<StereoFeature> find_stereo_features(const FrameImages& images, const Rig& rig,
                                                const StructureOptions& options) {
  const cv::Mat& image = images.left.level(0);
  const int cell_px = std::max(options.corner_cell_px, CellGrid::smallest_cell_px(image.cols));
  const int columns = (image.cols + cell_px - 1) / cell_px;
  const int rows = (image.rows + cell_px - 1) / cell_px;
  const std::vector<std::uint8_t> free(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  std::vector<Corner> corners;
  corners.reserve(free.size());
  detect_corners(image, 0, options.corner_threshold, options.min_corner_score, kBorder,
                 {cell_px, columns, rows, free}, corners);
  std::vector<StereoFeature> features;
  for (const Corner& corner : corners) {
    StereoFeature feature;
    if (!cut_patch(image, corner.u, corner.v, feature.patch)) continue;
    const double u_r = right_from_row(images, rig, corner.u, corner.v, 0, options.search);
    feature.pixel = Vector3(corner.u, corner.v, u_r);
    feature.score = corner.score;
    if (!(corner.u - u_r >= options.min_disparity_px)) continue;  // also when there is none
    features.push_back(feature);
  }
  return features;
}

Matrix3 stereo_covariance(const Rig& rig, const StereoPixel& z, double sigma_px) {
  const Matrix3 J = rig.project_jacobian(rig.unproject(z)).inverse();
  return sigma_px * sigma_px * J * J.transpose();
}

std::vector<FeatureMatch> match_features(const std::vector<StereoFeature>& previous,
                                         const std::vector<StereoFeature>& current, double reach_px,
                                         double max_ratio) {
  std::vector<int> previous_mean, current_mean;
  for (const StereoFeature& f : previous) previous_mean.push_back(mean_of(f.patch));
  for (const StereoFeature& f : current) current_mean.push_back(mean_of(f.patch));
  std::vector<Best> forward(previous.size()), backward(current.size());
  for (std::size_t p = 0; p < previous.size(); ++p) {
    for (std::size_t c = 0; c < current.size(); ++c) {
      const Vector2 move = current[c].pixel.head<2>() - previous[p].pixel.head<2>();
      if (move.cwiseAbs().maxCoeff() > reach_px) continue;
      const int cost =
          sum_of_differences(previous[p].patch, current[c].patch, previous_mean[p] - current_mean[c]);
      forward[p].offer(static_cast<int>(c), cost);
      backward[c].offer(static_cast<int>(p), cost);
    }
  }
  std::vector<FeatureMatch> matches;
  for (std::size_t p = 0; p < previous.size(); ++p) {
    const Best& best = forward[p];
    if (best.index < 0 || backward[static_cast<std::size_t>(best.index)].index != static_cast<int>(p))
      continue;
    if (best.cost > max_ratio * best.second) continue;
    matches.push_back({static_cast<int>(p), best.index});
  }
  return matches;
}

std::vector<FeatureMatch> consistent_feature_matches(const std::vector<StereoFeature>& previous,
                                                     const std::vector<StereoFeature>& current,
                                                     const std::vector<FeatureMatch>& matches, const Rig& rig,
                                                     const StructureOptions& options) {
  std::vector<PointMatch3d> points;
  for (const FeatureMatch& match : matches) {
    const StereoPixel& z_0 = previous[static_cast<std::size_t>(match.previous)].pixel;
    const StereoPixel& z_1 = current[static_cast<std::size_t>(match.current)].pixel;
    const double sigma = std::hypot(options.sigma_px, kWholePixelSigma);
    points.push_back({rig.unproject(z_0), rig.unproject(z_1), stereo_covariance(rig, z_0, sigma),
                      stereo_covariance(rig, z_1, sigma)});
  }
  std::vector<FeatureMatch> consistent;
  for (const int i : consistent_matches(points, options.consistency)) {
    consistent.push_back(matches[static_cast<std::size_t>(i)]);
  }
  return consistent;
}

}  // namespace twofold
