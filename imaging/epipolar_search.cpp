#include "imaging/epipolar_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/option_check.hpp"
#include "geometry/inverse_depth.hpp"
#include "imaging/level_pixels.hpp"
#include "imaging/patch.hpp"

namespace twofold {
namespace {

constexpr int kMaxSteps = 320;              // places compared: bounds time and memory
constexpr double kAsGoodAsInfinite = 1e-6;  // inverse depth: how a patch looks is asked of some depth

struct Place {
  Eigen::Vector2i uv;
  int ssd = std::numeric_limits<int>::max();
};

/// Costs at whole pixels along the stretch.
struct LineCosts {
  std::array<Place, kMaxSteps> places;
  int count = 0;
  int best = 0;

  LineCosts(const Patch& patch, const cv::Mat& image, const EpipolarStretch& stretch, float step_px) {
    const int steps = static_cast<int>(stretch.length_px() / step_px) + 1;
    constexpr int kMargin = Patch::kSize;
    for (int s = 0; s <= steps && count < kMaxSteps; ++s) {
      const float share = static_cast<float>(s) / static_cast<float>(steps);
      const Eigen::Vector2f at = stretch.far + share * (stretch.near - stretch.far);
      const Eigen::Vector2i uv(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())));
      if (uv.x() < kMargin || uv.y() < kMargin || uv.x() >= image.cols - kMargin ||
          uv.y() >= image.rows - kMargin) {
        continue;
      }
      if (count > 0 && places[static_cast<std::size_t>(count - 1)].uv == uv) continue;
      places[static_cast<std::size_t>(count)] = {uv, zero_mean_ssd(patch, image, uv.x(), uv.y())};
      if (places[static_cast<std::size_t>(count)].ssd < places[static_cast<std::size_t>(best)].ssd)
        best = count;
      ++count;
    }
  }

  /// Nothing else on the line looks about as much alike.
  [[nodiscard]] bool stands_out(float beside_px) const {
    const Place& found = places[static_cast<std::size_t>(best)];
    int second = std::numeric_limits<int>::max();
    for (int i = 0; i < count; ++i) {
      const Place& other = places[static_cast<std::size_t>(i)];
      if ((other.uv - found.uv).cast<float>().norm() > beside_px) second = std::min(second, other.ssd);
    }
    return is_unambiguous(found.ssd, second);
  }
};

/// Distance of a point from the stretch [level px].
float distance(const EpipolarStretch& stretch, const Eigen::Vector2f& uv) {
  const Eigen::Vector2f along = stretch.near - stretch.far;
  const float squared = along.squaredNorm();
  const float share = squared > 0 ? std::clamp(along.dot(uv - stretch.far) / squared, 0.0F, 1.0F) : 0.0F;
  return (uv - stretch.far - share * along).norm();
}

}  // namespace

std::string EpipolarSearchOptions::invalid_reason() const {
  return OptionCheck()
      .above("step_px", step_px, 0)
      .at_least("beside_px", beside_px, 0)
      .at_least("beyond_px", beyond_px, 0)
      .share("nearest_share", nearest_share)
      .reason();
}

std::optional<EpipolarStretch> epipolar_stretch(const PinholeCamera& camera,
                                                const PointAppearance& appearance, const Vector3& ray_a,
                                                const SE3& T_c_a, const InverseDepthRange& range,
                                                const EpipolarSearchOptions& line) {
  const Vector3 turned = T_c_a.rotation() * ray_a;
  const Vector3& t = T_c_a.translation();
  if (!(turned.z() > 0)) return std::nullopt;
  // In units of the point's depth in its anchor: turned + q t.
  double most = range.most;
  if (t.z() < 0) most = std::min(most, (1 - line.nearest_share) * turned.z() / -t.z());
  if (most < range.least) return std::nullopt;
  const double likely = std::max(std::min(range.likely, most), kAsGoodAsInfinite);
  const auto warp = predict_warp(camera, {ray_a.x(), ray_a.y(), likely}, T_c_a);
  if (!warp) return std::nullopt;
  const auto level = search_level(warp->A_c_a, appearance.level);
  if (!level) return std::nullopt;
  return EpipolarStretch{*level, warp->A_c_a, to_level(camera.project(turned + range.least * t), *level),
                         to_level(camera.project(turned + most * t), *level)};
}

std::optional<PointMatch> find_along(const ImagePyramid& images, const PointAppearance& appearance,
                                     const EpipolarStretch& stretch, const GuidedSearchOptions& options,
                                     const EpipolarSearchOptions& line) {
  if (!(stretch.length_px() < line.step_px * (kMaxSteps - 1))) return std::nullopt;
  Patch patch;
  warp_patch(appearance, stretch.A_c_a, stretch.level, patch);
  const cv::Mat& image = images.level(stretch.level);
  const LineCosts costs(patch, image, stretch, line.step_px);
  if (costs.count == 0 || !costs.stands_out(line.beside_px)) return std::nullopt;
  const Place& best = costs.places[static_cast<std::size_t>(costs.best)];
  const auto aligned = align_patch(patch, image, best.uv.cast<float>(), options.refine_iterations);
  if (!aligned || !looks_alike(patch, aligned->rms, options)) return std::nullopt;
  if (distance(stretch, aligned->uv) > line.beyond_px) return std::nullopt;
  const Vector2 uv = from_level(aligned->uv, stretch.level);
  return PointMatch{{uv.x(), uv.y(), Rig::kNoRight}, stretch.level, aligned->rms};
}

}  // namespace twofold
