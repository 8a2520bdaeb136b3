#include "tracking/keyframes/new_points.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMaxSeeds = 600;

}  // namespace

NewPoints::NewPoints(const Rig& rig, const TrackerOptions& options, const FixedPixels& fixed)
    : rig_(rig),
      options_(rig.kind == SensorKind::kMono ? with_cells_of_one_camera(rig, options.new_points)
                                             : options.new_points),
      starter_(rig, options_, options.search, &fixed),
      seeds_(rig, options.search, options_.seeds, kMaxSeeds) {
  corners_.reserve(static_cast<std::size_t>(options_.max_points));
}

int NewPoints::start_first(const FrameImages& images, KeyframeId anchor, const RollingShutter& shutter,
                           ImmaturePoints& immature_points) {
  starter_.clear();
  return starter_.start(images, anchor, shutter, immature_points);
}

void NewPoints::start(const FrameImages& images, KeyframeId anchor, const LocalMap& local_map,
                      const FrameStep& step, SearchOutcome& found, ImmaturePoints& immature_points) {
  starter_.clear();
  for (std::size_t m = 0; m < found.matches.size(); ++m) {
    if (found.observations[m].inlier) starter_.occupy(found.matches[m].found.pixel.head<2>().cast<float>());
  }
  const bool enough_found = static_cast<int>(found.matches.size()) >= step.bounds.wanted_matches;
  if (enough_found && rig_.kind != SensorKind::kRgbd)
    occupy_unsearched(local_map, step.result.T_c_ref, found.candidates);
  if (rig_.kind != SensorKind::kMono) starter_.start(images, anchor, step.shutter, immature_points);
  start_seeds(images, anchor, step.shutter);
}

void NewPoints::start_seeds_between(const FrameImages& images, KeyframeId anchor,
                                    const ImmaturePoints& points) {
  starter_.clear();
  for (const ImmaturePoint& point : points.points()) starter_.occupy(point.appearance.uv);
  start_seeds(images, anchor, {});
}

/// Where the map has points that nobody looked for, because enough others had been found: a place seen again
/// would get new ones for ever. Depth cameras are left out: they gained nothing by it, and had fewer fresh
/// points when frames blurred (docs/results/variations.md, seldom frames).
void NewPoints::occupy_unsearched(const LocalMap& local_map, const SE3& T_c_ref, Quadtree& candidates) {
  for (std::int64_t i = candidates.next(); i >= 0; i = candidates.next()) {
    const TrackedPoint& point = local_map.points()[static_cast<std::size_t>(i)];
    if (point.immature >= 0) continue;  // few of these will ever be points of the map
    const auto uv = rig_.camera.find_in_view(T_c_ref * point.x_ref);
    if (uv) starter_.occupy(uv->cast<float>());
  }
}

void NewPoints::start_seeds(const FrameImages& images, KeyframeId anchor, const RollingShutter& shutter) {
  seeds_.begin_keyframe(anchor);
  const bool one_camera = rig_.kind == SensorKind::kMono;
  if (!one_camera && !starter_.depth_is_scarce()) return;
  seeds_.for_places([&](const Eigen::Vector2f& uv) { starter_.occupy(uv); });
  const int wanted = one_camera ? options_.max_points : options_.seeded_points - starter_.points_in_view();
  corners_.clear();
  starter_.choose_corners(images, wanted, corners_);
  for (const PointAppearance& appearance : corners_) seeds_.add(anchor, appearance, shutter);
}

}  // namespace twofold
