#include "imaging/guided_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "imaging/level_pixels.hpp"

namespace twofold {
namespace {

constexpr double kNearestBaselines = 2.5;  // a nearer point is seen by one camera of a pair only
constexpr int kNoiseSsd = 4 * 64 * 4;      // four times what noise of two grey levels adds to a patch
constexpr int kOctaves = 3;  // two pixels of so many levels higher are as wide as what was kept of the look
constexpr float kBlack = 4;  // [grey] darker tells nothing
constexpr double kDisparityJump = 2.0;  // [px] more than noise and any slanted surface show over three pixels
constexpr int kBeside = 3;              // [px] costs so near to the best are low because that is
constexpr int kMargin = Patch::kSize;   // whole patches, and room for the sub-pixel search around them

/// Best whole pixel within the radius; nothing when the window leaves the image.
std::optional<Eigen::Vector2f> search_disc(const Patch& patch, const cv::Mat& image,
                                           const Eigen::Vector2f& centre, double radius) {
  const int u0 = static_cast<int>(std::lround(centre.x()));
  const int v0 = static_cast<int>(std::lround(centre.y()));
  const int r = static_cast<int>(std::ceil(radius));
  if (u0 - r < kMargin || v0 - r < kMargin || u0 + r >= image.cols - kMargin ||
      v0 + r >= image.rows - kMargin) {
    return std::nullopt;
  }
  int best = std::numeric_limits<int>::max();
  Eigen::Vector2f best_uv = centre;
  for (int dv = -r; dv <= r; ++dv) {
    for (int du = -r; du <= r; ++du) {
      if (du * du + dv * dv > radius * radius + 0.5) continue;
      const int ssd = zero_mean_ssd(patch, image, u0 + du, v0 + dv);
      if (ssd < best) {
        best = ssd;
        best_uv = {static_cast<float>(u0 + du), static_cast<float>(v0 + dv)};
      }
    }
  }
  return best_uv;
}

double search_right(const Patch& patch, const cv::Mat& right, const Eigen::Vector2f& left_uv,
                    double predicted_u, int level, const GuidedSearchOptions& options) {
  const int v = static_cast<int>(std::lround(left_uv.y()));
  const int centre = static_cast<int>(std::lround(predicted_u));
  const int r = static_cast<int>(options.right_search_px);
  const int first = std::max(centre - r, kMargin);
  const int last =
      std::min({centre + r, static_cast<int>(std::lround(left_uv.x())) + 1, right.cols - 1 - kMargin});
  if (first > last || v < kMargin || v >= right.rows - kMargin) return Rig::kNoRight;
  int best = std::numeric_limits<int>::max();
  int best_u = first;
  for (int u = first; u <= last; ++u) {
    const int ssd = zero_mean_ssd(patch, right, u, v);
    if (ssd < best) {
      best = ssd;
      best_u = u;
    }
  }
  const auto aligned =
      align_patch_in_row(patch, right, {static_cast<float>(best_u), left_uv.y()}, options.refine_iterations);
  if (!aligned || !looks_alike(patch, aligned->rms, options)) return Rig::kNoRight;
  const double u_r = from_level(aligned->uv.x(), level);
  return u_r < from_level(left_uv.x(), level) ? u_r : Rig::kNoRight;
}

}  // namespace

bool is_unambiguous(std::int64_t best, std::int64_t second) {
  return second * 4 > best * 5 + kNoiseSsd;
}

bool looks_alike(const Patch& patch, float rms, const GuidedSearchOptions& options) {
  return rms <= options.max_rms && rms <= options.max_rms_share * patch.deviation + options.noise;
}

std::optional<PointMatch> find_point(const FrameImages& images, const Rig& rig,
                                     const PointAppearance& appearance, const Vector3& psi, const SE3& T_c_a,
                                     const GuidedSearchOptions& options) {
  const auto warp = predict_warp(rig.camera, psi, T_c_a);
  if (!warp || !rig.camera.contains(warp->uv)) return std::nullopt;
  const auto level = search_level(warp->A_c_a, appearance.level);
  if (!level) return std::nullopt;
  Patch patch;
  warp_patch(appearance, warp->A_c_a, *level, patch);
  if (options.gain != 1) scale_contrast(patch, options.gain);
  const cv::Mat& image = images.left.level(*level);
  const auto found = search_disc(patch, image, to_level(warp->uv, *level), options.radius_px);
  if (!found) return std::nullopt;
  const auto aligned = align_patch(patch, image, *found, options.refine_iterations);
  if (!aligned || !looks_alike(patch, aligned->rms, options)) return std::nullopt;

  PointMatch match;
  match.level = *level;
  match.rms = aligned->rms;
  match.pixel = {from_level(aligned->uv.x(), *level), from_level(aligned->uv.y(), *level), Rig::kNoRight};
  if (rig.kind == SensorKind::kStereo && !images.right.empty()) {
    const double u_r = match.pixel.x() - rig.disparity_from_depth(warp->depth);
    const double predicted = to_level(u_r, *level);
    match.pixel.z() =
        search_right(patch, images.right.level(*level), aligned->uv, predicted, *level, options);
  } else if (rig.kind == SensorKind::kRgbd && !images.depth.empty()) {
    match.pixel.z() = right_from_depth(images.depth, rig, match.pixel.x(), match.pixel.y());
  }
  return match;
}

std::optional<float> brightness_since_anchor(const ImagePyramid& images, const PinholeCamera& camera,
                                             const PointAppearance& appearance, const Vector3& psi,
                                             const SE3& T_c_a) {
  const auto warp = predict_warp(camera, psi, T_c_a);
  if (!warp || !camera.contains(warp->uv)) return std::nullopt;
  const int level = std::min(appearance.level + kOctaves, ImagePyramid::kLevels - 1);
  const cv::Mat& image = images.level(level);
  const Eigen::Vector2f uv = to_level(warp->uv, level);
  const int u = std::clamp(static_cast<int>(std::floor(uv.x())), 0, image.cols - 2);
  const int v = std::clamp(static_cast<int>(std::floor(uv.y())), 0, image.rows - 2);
  const auto *upper = image.ptr<std::uint8_t>(v) + u, *lower = image.ptr<std::uint8_t>(v + 1) + u;
  const auto now = static_cast<float>(upper[0] + upper[1] + lower[0] + lower[1]) / 4;
  const auto then =
      static_cast<float>(std::accumulate(appearance.pixels.begin(), appearance.pixels.end(), 0)) /
      static_cast<float>(appearance.pixels.size());
  return now > kBlack && then > kBlack ? std::optional(now / then) : std::nullopt;
}

namespace {

/// Nine depth readings in order, by exchanges that are the same whatever they are: nothing for the processor
/// to guess, which it would get wrong every other time.
void sort_nine(std::array<std::uint16_t, 9>& r) {
  constexpr std::array<std::array<std::uint8_t, 2>, 25> kExchanges{
      {{0, 1}, {3, 4}, {6, 7}, {1, 2}, {4, 5}, {7, 8}, {0, 1}, {3, 4}, {6, 7}, {0, 3}, {3, 6}, {0, 3}, {1, 4},
       {4, 7}, {1, 4}, {2, 5}, {5, 8}, {2, 5}, {1, 3}, {5, 7}, {2, 6}, {4, 6}, {2, 4}, {2, 3}, {5, 6}}};
  for (const auto [a, b] : kExchanges) {
    const std::uint16_t lower = std::min(r[a], r[b]), higher = std::max(r[a], r[b]);
    r[a] = lower, r[b] = higher;
  }
}

}  // namespace

double right_from_depth(const cv::Mat& depth, const Rig& rig, double u, double v) {
  const int u0 = static_cast<int>(std::lround(u));
  const int v0 = static_cast<int>(std::lround(v));
  if (u0 < 1 || v0 < 1 || u0 >= depth.cols - 1 || v0 >= depth.rows - 1) return Rig::kNoRight;
  constexpr std::uint16_t kNone = 0xffff;  // comes last
  std::array<std::uint16_t, 9> readings;
  std::size_t at = 0, count = 0;
  for (int dv = -1; dv <= 1; ++dv) {
    const auto* row = depth.ptr<std::uint16_t>(v0 + dv) + u0;
    for (int du = -1; du <= 1; ++du) {
      const double metres = row[du] * rig.depth_unit;
      const bool valid = metres >= rig.depth_min && metres <= rig.depth_max;
      readings[at++] = valid ? row[du] : kNone;
      count += valid ? 1 : 0;
    }
  }
  if (count < 5) return Rig::kNoRight;
  sort_nine(readings);
  const auto disparity = [&](std::size_t i) {
    return rig.disparity_from_depth(readings[i] * rig.depth_unit);
  };
  const double near = disparity(0);
  const double far = disparity(count - 1);
  if (near - far > kDisparityJump) return Rig::kNoRight;
  return u - disparity(count / 2);
}

namespace {

/// Cost of the patch at every pixel [first, first + count) of a row, and where it is least.
struct RowCosts {
  int first = 0;
  int count = 0;
  int best_u = 0;
  int best = std::numeric_limits<int>::max();
  std::array<int, kMaxRowCosts> cost;

  RowCosts(const Patch& patch, const cv::Mat& image, int v, int from, int to)
      : first(from), count(std::min(to - from + 1, kMaxRowCosts)) {
    zero_mean_ssd_row(patch, image, first, v, std::span(cost).first(static_cast<std::size_t>(count)));
    best = least(0, count);
    best_u = first + static_cast<int>(std::find(cost.begin(), cost.begin() + count, best) - cost.begin());
  }
  /// Least cost elsewhere, not beside the best: near to `best` where texture repeats.
  [[nodiscard]] int second_best() const {
    const int at = best_u - first;
    return std::min(least(0, at - kBeside), least(at + kBeside + 1, count));
  }
  /// Of the entries [from, to). A plain reduction, which compilers vectorise; std::min_element is none.
  [[nodiscard]] int least(int from, int to) const {
    int result = std::numeric_limits<int>::max();
    for (int i = from; i < to; ++i) result = std::min(result, cost[static_cast<std::size_t>(i)]);
    return result;
  }
};

/// The pixel found in the right image, looked for in the left one, is found where it came from.
bool leads_back(const cv::Mat& left, const cv::Mat& right, int u_right, int u_left, int v, int range) {
  Patch patch;
  if (!cut_patch(right, u_right, v, patch)) return false;
  const RowCosts costs(patch, left, v, std::max(u_right, kMargin),
                       std::min(u_right + range, left.cols - 1 - kMargin));
  return std::abs(costs.best_u - u_left) <= 1;
}

}  // namespace

double right_from_row(const FrameImages& images, const Rig& rig, int u, int v, int level,
                      const GuidedSearchOptions& options) {
  return right_from_row(images.left.level(level), images.right.level(level), rig, u, v, level, options);
}

double right_from_row(const cv::Mat& left, const cv::Mat& right, const Rig& rig, int u, int v, int level,
                      const GuidedSearchOptions& options) {
  Patch patch;
  if (!cut_patch(left, u, v, patch)) return Rig::kNoRight;
  // Nearer than a few baselines hardly anything is in both images of a parallel rig.
  const double nearest = kNearestBaselines * rig.baseline;
  const int range = static_cast<int>(rig.disparity_from_depth(nearest) * std::ldexp(1.0, -level));
  const int first = std::max(u - range, kMargin);
  const int last = std::min(u, right.cols - 1 - kMargin);
  if (first > last || v < kMargin || v >= right.rows - kMargin) return Rig::kNoRight;
  const RowCosts costs(patch, right, v, first, last);
  const std::int64_t second = costs.second_best();
  if (!is_unambiguous(costs.best, second)) return Rig::kNoRight;
  const auto aligned = align_patch_in_row(
      patch, right, {static_cast<float>(costs.best_u), static_cast<float>(v)}, options.refine_iterations);
  if (!aligned || !looks_alike(patch, aligned->rms, options) || aligned->uv.x() >= static_cast<float>(u)) {
    return Rig::kNoRight;
  }
  // Not quite alone: the match looked for in the left image must lead back.
  if (second < std::int64_t{costs.best} * 3 && !leads_back(left, right, costs.best_u, u, v, range)) {
    return Rig::kNoRight;
  }
  return from_level(aligned->uv.x(), level);
}

double right_of_corner(const FrameImages& images, const Rig& rig, const Vector2& uv, int level,
                       const GuidedSearchOptions& options) {
  if (rig.kind == SensorKind::kMono) return Rig::kNoRight;
  if (rig.kind == SensorKind::kRgbd) return right_from_depth(images.depth, rig, uv.x(), uv.y());
  const Eigen::Vector2f on_level = to_level(uv, level);
  return right_from_row(images, rig, static_cast<int>(std::lround(on_level.x())),
                        static_cast<int>(std::lround(on_level.y())), level, options);
}

}  // namespace twofold
