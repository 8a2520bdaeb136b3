#include "tracking/monocular/depth_seeds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/option_check.hpp"

namespace twofold {
namespace {

/// Least squares inverse depth of a ray of the anchor that is seen at uv.
double triangulated(const PinholeCamera& camera, const Vector3& ray_a, const SE3& T_c_a, const Vector2& uv) {
  const Vector3 bearing = camera.unproject(uv);
  const Vector3 sight = bearing.cross(T_c_a.translation());
  return -sight.dot(bearing.cross(T_c_a.rotation() * ray_a)) / std::max(sight.squaredNorm(), 1e-300);
}

}  // namespace

std::string DepthSeedOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_observed", max_observed, 1)
      .above("min_depth_share", min_depth_share, 0)
      .at_least("min_stretch_px", min_stretch_px, 0)
      .above("range_sigmas", range_sigmas, 0)
      .above("min_gain", min_gain, 0)
      .at_least("min_looks", min_looks, 1)
      .above("near_error", near_error, 0)
      .at_least("far_error", far_error, 0)
      .at_least("max_misses", max_misses, 1)
      .at_least("max_first_misses", max_first_misses, 1)
      .at_least("max_age", max_age, 1)
      .nested("line", line.invalid_reason())
      .at_least("filter_iterations", filter_iterations, 1)
      .above("min_inverse_depth", min_inverse_depth, 0)
      .above("unknown_sigma", unknown_sigma, 0)
      .reason();
}

DepthSeeds::DepthSeeds(const Rig& rig, const GuidedSearchOptions& search, const DepthSeedOptions& options,
                       std::size_t capacity)
    : rig_(rig), search_(search), options_(options) {
  seeds_.reserve(capacity);
}

void DepthSeeds::add(KeyframeId anchor, const PointAppearance& appearance, const RollingShutter& shutter) {
  if (seeds_.size() == seeds_.capacity()) return;
  Seed seed;
  seed.anchor = anchor;
  seed.appearance = appearance;
  seed.uv = appearance.uv;
  seed.number = ++last_number_;
  seed.shutter = shutter;
  seed.filter = InverseDepthFilter::from_mono(rig_.camera, appearance.uv.cast<double>(),
                                              rig_.sigma_px(appearance.level));
  seeds_.push_back(seed);
}

void DepthSeeds::begin_keyframe(KeyframeId newest) {
  newest_ = newest;
  std::erase_if(seeds_, [&](const Seed& seed) {
    return index(newest) - index(seed.anchor) > static_cast<std::uint32_t>(options_.max_age);
  });
}

InverseDepthRange DepthSeeds::range_of(const Seed& seed, double median_depth) const {
  const double nearest = 1 / (options_.min_depth_share * median_depth);
  if (!known(seed)) return {0, nearest, 1 / median_depth};
  const double half = options_.range_sigmas * seed.filter.inverse_depth_sigma();
  const double q = seed.filter.psi.z();
  return {std::clamp(q - half, 0.0, nearest), std::clamp(q + half, 0.0, nearest),
          std::clamp(q, 0.0, nearest)};
}

/// A look along much less parallax than what is known came from adds nothing but its errors. Another one from
/// the same place counts: it says better where the point is seen from there.
bool DepthSeeds::worth_a_look(const Seed& seed, const EpipolarStretch& stretch, const SE3& T_c_row) const {
  if (!known(seed)) return stretch.length_px() > options_.min_stretch_px;
  const auto p = project_inverse_depth(rig_, T_c_row, seed.filter.psi);
  if (!p) return false;
  const double sigma = seed.filter.inverse_depth_sigma();
  const double per_px = p->J_psi.col(2).head<2>().norm() / rig_.sigma_px(stretch.level);
  return per_px * per_px * sigma * sigma > options_.min_gain;
}

/// Where the camera was when the corner's row was exposed.
SE3 DepthSeeds::T_anchor_row(const Seed& seed) const {
  return seed.shutter.T_row_c(seed.appearance.uv.y()).inverse();
}

/// The row on which a corner is seen, and so when, is that of its likely depth until it is found.
void DepthSeeds::look(Seed& seed, const ImagePyramid& images, const RollingShutter& shutter, const SE3& T_c_a,
                      double median_depth) const {
  const SE3 T_c_row = seed.shutter.at_rest() ? T_c_a : T_c_a * T_anchor_row(seed);
  const Vector3 ray(seed.filter.psi.x(), seed.filter.psi.y(), 1);
  const InverseDepthRange range = range_of(seed, median_depth);
  const Vector3 likely = ray / std::max(range.likely, options_.min_inverse_depth / median_depth);
  const SE3 T_seen_row = shutter.seen_from(rig_, T_c_row, likely);
  const auto stretch = epipolar_stretch(rig_.camera, seed.appearance, ray, T_seen_row, range, options_.line);
  if (!stretch) return;
  if (!worth_a_look(seed, *stretch, T_seen_row)) return;
  const auto found = find_along(images, seed.appearance, *stretch, search_, options_.line);
  if (!found) {
    ++seed.misses;
    return;
  }
  const SE3 T_found_row = shutter.at_row(found->pixel.y(), T_c_row);
  if (!known(seed)) {
    seed.filter.psi.z() = std::max(0.0, triangulated(rig_.camera, ray, T_found_row, found->pixel.head<2>()));
  }
  if (!seed.filter.update(rig_, T_found_row, found->pixel, rig_.sigma_px(found->level),
                          options_.filter_iterations)) {
    ++seed.misses;
    return;
  }
  seed.uv = found->pixel.head<2>().cast<float>();
  seed.misses = 0;
  ++seed.looks;
}

bool DepthSeeds::mature(const Seed& seed, double median_depth) const {
  if (seed.looks < options_.min_looks) return false;
  const double q = std::max(seed.filter.psi.z(), 0.0);
  return seed.filter.inverse_depth_sigma() <
         std::max(options_.near_error * q, options_.far_error / median_depth);
}

ImmaturePoint DepthSeeds::point_of(const Seed& seed, double median_depth) const {
  ImmaturePoint point;
  point.anchor = seed.anchor;
  point.usable_since = newest_;
  point.appearance = seed.appearance;
  point.psi = seed.filter.psi;
  point.psi.z() = std::max(point.psi.z(), options_.min_inverse_depth / median_depth);
  point.anchor_observation.pixel = {seed.appearance.uv.x(), seed.appearance.uv.y(),
                                    static_cast<float>(Rig::kNoRight)};
  point.anchor_observation.level = seed.appearance.level;
  move_to_mid_exposure(rig_, seed.shutter, point);
  return point;
}

ImmaturePoint DepthSeeds::ray_of(const Seed& seed, double median_depth) const {
  ImmaturePoint ray = point_of(seed, median_depth);
  const double most = options_.unknown_sigma / median_depth, sigma = seed.filter.inverse_depth_sigma();
  if (!known(seed) || !(sigma < most)) ray.psi.z() = 1 / median_depth;
  ray.ray_sigma = known(seed) ? std::min(sigma, most) : most;
  ray.seed = seed.number;
  return ray;
}

void DepthSeeds::lend_rays(double median_depth, ImmaturePoints& points) {
  for (Seed& seed : seeds_) seed.lent = seed.lent || points.add(ray_of(seed, median_depth));
}

/// What was learnt of a seed moves its ray; without its seed a ray is given up.
void DepthSeeds::update_rays(double median_depth, ImmaturePoints& points) {
  bool any = false;
  for (ImmaturePoint& point : points.points()) {
    if (!point.is_ray()) continue;
    any = true;
    const auto seed = std::lower_bound(seeds_.begin(), seeds_.end(), point.seed,
                                       [](const Seed& s, std::uint32_t number) { return s.number < number; });
    if (seed == seeds_.end() || seed->number != point.seed) {
      point.failures = std::numeric_limits<std::uint8_t>::max();
      continue;
    }
    const ImmaturePoint ray = ray_of(*seed, median_depth);
    point.psi = ray.psi;
    point.ray_sigma = ray.ray_sigma;
  }
  if (any) points.changed();
}

/// A ray becomes a point where it stands: others refer to its position.
/// @return false when there is no room
bool DepthSeeds::hand_over(const Seed& seed, double median_depth, ImmaturePoints& ready) const {
  const ImmaturePoint point = point_of(seed, median_depth);
  if (!seed.lent) return ready.add(point);
  auto& points = ready.points();
  const auto ray = std::find_if(points.begin(), points.end(),
                                [&](const ImmaturePoint& p) { return p.is_ray() && p.seed == seed.number; });
  if (ray == points.end()) return ready.add(point);
  *ray = point;
  ready.changed();
  return true;
}

/// Hands over what is known well enough, and gives up what was not found again.
void DepthSeeds::keep_immature(double median_depth, ImmaturePoints& ready) {
  std::erase_if(seeds_, [&](const Seed& seed) {
    if (seed.misses >= (known(seed) ? options_.max_misses : options_.max_first_misses)) return true;
    return mature(seed, median_depth) && hand_over(seed, median_depth, ready);
  });
  update_rays(median_depth, ready);
}

}  // namespace twofold
