#include "tracking/monocular/turned_lens.hpp"

#include <cmath>
#include <vector>

#include "geometry/view_rotation.hpp"

namespace twofold {
namespace {

constexpr double kFarthest = 2.5;     // times too long or too short: no guess is worse
constexpr double kCoarseStep = 1.12;  // between those tried: the peak of what a rotation explains is as wide
constexpr double kFinestStep =
    1.005;  // less moves corners at the edge by half a pixel in a turn of a hundred

std::vector<Vector3> with_focal_length(std::span<const Vector3> points, double scale) {
  std::vector<Vector3> bearings;
  bearings.reserve(points.size());
  for (const Vector3& p : points) bearings.emplace_back(p.x() / scale, p.y() / scale, p.z());
  return bearings;
}

}  // namespace

TurnedLens turned_lens(std::span<const Vector3> first, std::span<const Vector3> last,
                       const RansacOptions& options) {
  TurnedLens best;
  const auto attempt = [&](double scale) {
    RansacOptions scaled = options;
    scaled.threshold /= scale;
    const auto rotation =
        estimate_view_rotation(with_focal_length(first, scale), with_focal_length(last, scale), scaled);
    const int explained = rotation ? static_cast<int>(rotation->inliers.size()) : 0;
    if (explained > best.explained) best = {scale, explained};
  };
  for (double scale = 1 / kFarthest; scale < kFarthest; scale *= kCoarseStep) attempt(scale);
  for (double step = std::sqrt(kCoarseStep); step > kFinestStep; step = std::sqrt(step)) {
    const double middle = best.focal_scale;
    attempt(middle / step);
    attempt(middle * step);
  }
  return best;
}

}  // namespace twofold
