#include "tracking/monocular/metric_scale.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "base/median.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

constexpr float kMinGradient = 6;           // of a pixel, or noise says where it is [grey/px]
constexpr std::size_t kMostPixels = 1500;   // of a frame: more are no more exact than the motion itself
constexpr std::size_t kFewestPixels = 200;  // of both: a dozen thin lines, each seen over and over
constexpr float kMostDifference = 30;       // of what shows something else: more tells nothing [grey]
constexpr float kSameDifference = 12;       // of what shows the same, noise and light included [grey]
constexpr double kMostShift = 0.25;         // of the pixels, as a share of the image's width
constexpr int kLeastShift = 5;     // with less a wrong turn of a tenth of a degree is a tenth of it [px]
constexpr int kNeighbours = 3;     // texture is alike over so many pixels: such scales are the best one's own
constexpr double kDistinct = 0.9;  // of the mean difference at any other scale; with right motions it was
                                   // 0.66 to 0.9 in a courtyard
constexpr int kRefinements = 6;

/// One frame's pixels, and the frame they are looked for in.
struct MeasuredPixels {
  struct Pixel {
    Vector3 x;  ///< in the other frame, had the camera only turned [m]
    float grey = 0;
  };
  const cv::Mat* other = nullptr;
  Vector3 t;  ///< of the motion to the other frame
  std::vector<Pixel> pixels;
};

/// Those that have a depth and differ from their neighbours.
MeasuredPixels measured_pixels(const Rig& rig, const FrameImages& images, const FrameImages& other,
                               const SE3& T_other_this) {
  MeasuredPixels view{&other.left.level(0), T_other_this.translation(), {}};
  const cv::Mat& image = images.left.level(0);
  for (int v = 1; v + 1 < image.rows; ++v) {
    const auto *above = image.ptr<std::uint8_t>(v - 1), *row = image.ptr<std::uint8_t>(v);
    const auto* below = image.ptr<std::uint8_t>(v + 1);
    for (int u = 1; u + 1 < image.cols; ++u) {
      const double depth = images.depth.at<std::uint16_t>(v, u) * rig.depth_unit;
      if (!(depth >= rig.depth_min && depth <= rig.depth_max)) continue;
      const Eigen::Vector2f gradient(0.5F * static_cast<float>(row[u + 1] - row[u - 1]),
                                     0.5F * static_cast<float>(below[u] - above[u]));
      if (gradient.norm() < kMinGradient) continue;
      const Vector3 x = rig.camera.unproject(Vector2(u, v)) * depth;
      view.pixels.push_back({T_other_this.so3() * x, static_cast<float>(row[u])});
    }
  }
  const std::size_t stride = view.pixels.size() / (kMostPixels + 1) + 1, all = view.pixels.size();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < all; i += stride) view.pixels[kept++] = view.pixels[i];
  view.pixels.resize(kept);
  return view;
}

struct Grey {
  float value = 0;
  Eigen::Vector2f gradient{0, 0};
};

/// Between four pixels.
std::optional<Grey> grey_at(const cv::Mat& image, const Vector2& uv) {
  if (!(uv.x() >= 0 && uv.y() >= 0 && uv.x() < image.cols - 1 && uv.y() < image.rows - 1))
    return std::nullopt;
  const int u = static_cast<int>(uv.x()), v = static_cast<int>(uv.y());
  const auto a = static_cast<float>(uv.x() - u), b = static_cast<float>(uv.y() - v);
  const auto *upper = image.ptr<std::uint8_t>(v) + u, *lower = image.ptr<std::uint8_t>(v + 1) + u;
  const float g00 = upper[0], g01 = upper[1], g10 = lower[0], g11 = lower[1];
  const float top = (1 - a) * g00 + a * g01, bottom = (1 - a) * g10 + a * g11;
  return Grey{(1 - b) * top + b * bottom, {(1 - b) * (g01 - g00) + b * (g11 - g10), bottom - top}};
}

class ScaleSearch {
 public:
  ScaleSearch(const Rig& rig, const FrameImages& a, const FrameImages& b, const SE3& T_b_a)
      : camera_(rig.camera),
        views_{measured_pixels(rig, a, b, T_b_a), measured_pixels(rig, b, a, T_b_a.inverse())} {}

  [[nodiscard]] std::optional<double> run() const {
    const double per_unit = shift_per_unit();
    if (views_[0].pixels.size() + views_[1].pixels.size() < kFewestPixels || !(per_unit > 0))
      return std::nullopt;
    const int most = static_cast<int>(kMostShift * camera_.width);
    std::vector<double> differences;
    for (int shift = 0; shift <= most; ++shift) differences.push_back(mean_difference(shift / per_unit));
    const auto best = std::min_element(differences.begin(), differences.end());
    const auto shift = static_cast<int>(best - differences.begin());
    if (shift < kLeastShift || !(*best < kDistinct * least_elsewhere(differences, shift)))
      return std::nullopt;
    double scale = shift / per_unit;
    for (int n = 0; n < kRefinements; ++n) scale += step(scale);
    return std::abs(scale * per_unit - shift) < kNeighbours ? std::optional(scale) : std::nullopt;
  }

 private:
  /// By how many pixels one unit of the motion moves them, in the median.
  [[nodiscard]] double shift_per_unit() const {
    constexpr double kLittle = 1e-3;  // of a unit
    std::vector<double> shifts;
    for (const MeasuredPixels& view : views_) {
      for (const MeasuredPixels::Pixel& pixel : view.pixels) {
        const Vector3 moved = pixel.x + kLittle * view.t;
        if (in_front_of_camera(pixel.x) && in_front_of_camera(moved))
          shifts.push_back((camera_.project(moved) - camera_.project(pixel.x)).norm() / kLittle);
      }
    }
    return shifts.empty() ? 0 : median(std::span(shifts));
  }

  /// What leaves the view counts as different: else that would be the best place for it.
  [[nodiscard]] double mean_difference(double scale) const {
    double sum = 0;
    for (const MeasuredPixels& view : views_) {
      for (const MeasuredPixels::Pixel& pixel : view.pixels) {
        const Vector3 x = pixel.x + scale * view.t;
        const auto seen = in_front_of_camera(x) ? grey_at(*view.other, camera_.project(x)) : std::nullopt;
        sum += seen ? std::min(std::abs(seen->value - pixel.grey), kMostDifference) : kMostDifference;
      }
    }
    return sum / static_cast<double>(views_[0].pixels.size() + views_[1].pixels.size());
  }

  [[nodiscard]] static double least_elsewhere(const std::vector<double>& differences, int shift) {
    double least = std::numeric_limits<double>::infinity();
    for (int n = 0; std::cmp_less(n, differences.size()); ++n) {
      if (std::abs(n - shift) > kNeighbours)
        least = std::min(least, differences[static_cast<std::size_t>(n)]);
    }
    return least;
  }

  /// Of Gauss-Newton, by the pixels that look the same.
  [[nodiscard]] double step(double scale) const {
    double information = 0, gradient = 0;
    for (const MeasuredPixels& view : views_) {
      for (const MeasuredPixels::Pixel& pixel : view.pixels) {
        const Vector3 x = pixel.x + scale * view.t;
        if (!in_front_of_camera(x)) continue;
        const auto seen = grey_at(*view.other, camera_.project(x));
        if (!seen || std::abs(seen->value - pixel.grey) > kSameDifference) continue;
        const double J = seen->gradient.cast<double>().dot(camera_.project_jacobian(x) * view.t);
        information += J * J;
        gradient += J * (seen->value - pixel.grey);
      }
    }
    return information > 0 ? -gradient / information : 0;
  }

  const PinholeCamera& camera_;
  std::array<MeasuredPixels, 2> views_;
};

}  // namespace

std::optional<double> metric_scale(const Rig& rig, const FrameImages& a, const FrameImages& b,
                                   const SE3& T_b_a) {
  return ScaleSearch(rig, a, b, T_b_a).run();
}

}  // namespace twofold
