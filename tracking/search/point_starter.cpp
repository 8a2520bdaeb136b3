#include "tracking/search/point_starter.hpp"

#include <algorithm>
#include <cmath>

#include "camera/measurement.hpp"
#include "geometry/inverse_depth.hpp"
#include "imaging/level_pixels.hpp"
#include "imaging/row_offset.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMaxCorners = 4096;
constexpr int kBorder = 12;  // of a level: room for the patch and its search

Eigen::Vector2f at_level_zero(const Corner& corner) {
  return {static_cast<float>(from_level(corner.u, corner.level)),
          static_cast<float>(from_level(corner.v, corner.level))};
}

}  // namespace

NewPointOptions with_cells_of_one_camera(const Rig& rig, NewPointOptions options) {
  constexpr int kUnit = 4;  // CellGrid
  const double area = static_cast<double>(rig.camera.width) * rig.camera.height;
  const double side = std::sqrt(area / (options.cells_per_corner * options.max_points));
  options.cell_px = std::min(options.cell_px, std::max(static_cast<int>(side) / kUnit * kUnit, 2 * kUnit));
  return options;
}

PointStarter::PointStarter(const Rig& rig, const NewPointOptions& options, const GuidedSearchOptions& search,
                           const FixedPixels* fixed)
    : rig_(rig),
      options_(options),
      search_(search),
      fixed_(fixed),
      quadtree_(rig.camera.width, rig.camera.height, kMaxCorners) {
  const int smallest = CellGrid::smallest_cell_px(rig.camera.width);
  options_.cell_px = std::max(options_.cell_px, smallest);
  options_.small_cell_px = std::clamp(options_.small_cell_px, smallest, options_.cell_px);
  lay_out(options_.small_cell_px);  // the most cells there ever are
  corners_.reserve(kMaxCorners);
  places_.reserve(kMaxCorners);
  lay_out(options_.cell_px);
}

/// Parts the image into cells anew; what is tracked stays where it is.
void PointStarter::lay_out(int cell_px) {
  cell_px_ = cell_px;
  columns_ = rig_.camera.width / cell_px + 1;
  rows_ = rig_.camera.height / cell_px + 1;
  occupied_.assign(static_cast<std::size_t>(columns_ * rows_), 0);
  for (const Eigen::Vector2f& uv : places_) occupied_[cell_of(uv)] = 1;
}

void PointStarter::clear() {
  places_.clear();
  lay_out(options_.cell_px);
  tracked_ = crowded_ = 0;
}

std::size_t PointStarter::cell_of(const Eigen::Vector2f& uv) const {
  const int u = std::clamp(static_cast<int>(uv.x()), 0, rig_.camera.width - 1) / cell_px_;
  const int v = std::clamp(static_cast<int>(uv.y()), 0, rig_.camera.height - 1) / cell_px_;
  return static_cast<std::size_t>(v * columns_ + u);
}

void PointStarter::occupy(const Eigen::Vector2f& uv) {
  occupied_[cell_of(uv)] = 1;
  if (places_.size() < places_.capacity()) places_.push_back(uv);
  ++tracked_;
}

PointStarter::CornerBounds PointStarter::usual_corners() const {
  return {0, options_.corner_threshold, options_.min_corner_score};
}

PointStarter::CornerBounds PointStarter::faint_corners() const {
  return {1, options_.faint_corners.threshold(options_.corner_threshold),
          options_.faint_corners.score(options_.min_corner_score)};
}

/// Corners of the free cells, into the quadtree; none of what moves with the camera.
void PointStarter::spread_corners(const FrameImages& images, const CornerBounds& bounds) {
  corners_.clear();
  const CellGrid grid{cell_px_, columns_, rows_, occupied_};
  for (int level = bounds.first_level; level < options_.corner_levels; ++level) {
    detect_corners(images.left.level(level), level, bounds.threshold, bounds.min_score, kBorder, grid,
                   corners_);
  }
  quadtree_.clear();
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const Eigen::Vector2f uv = at_level_zero(corners_[i]);
    if (fixed_ != nullptr && fixed_->touches(uv, corners_[i].level)) continue;
    quadtree_.insert(uv, static_cast<std::uint32_t>(i));
  }
}

int PointStarter::start(const FrameImages& images, KeyframeId anchor, const RollingShutter& shutter,
                        ImmaturePoints& immature) {
  with_depth_ = without_depth_ = crowded_ = 0;
  int started = start_at(usual_corners(), options_.max_points, images, anchor, shutter, immature);
  if (tracked_ < options_.scarce_points && mean_brightness(images.left) < options_.faint_corners.dark_below)
    started +=
        start_at(faint_corners(), options_.scarce_points - tracked_, images, anchor, shutter, immature);
  if (rig_.kind == SensorKind::kRgbd && tracked_ < options_.crowded_below && depth_is_scarce()) {
    lay_out(options_.small_cell_px);
    crowded_ =
        start_at(usual_corners(), options_.crowded_below - tracked_, images, anchor, shutter, immature);
    lay_out(options_.cell_px);
  }
  return started + crowded_;
}

int PointStarter::start_at(const CornerBounds& bounds, int wanted, const FrameImages& images,
                           KeyframeId anchor, const RollingShutter& shutter, ImmaturePoints& immature) {
  spread_corners(images, bounds);
  int started = 0;
  for (std::int64_t i = quadtree_.next(); i >= 0 && started < wanted; i = quadtree_.next()) {
    const Corner& corner = corners_[static_cast<std::size_t>(i)];
    const Eigen::Vector2f uv = at_level_zero(corner);
    ImmaturePoint point;
    point.anchor = point.usable_since = anchor;
    if (occupied_[cell_of(uv)] != 0) continue;
    if (!measure(images, corner, point)) {
      ++without_depth_;
      continue;
    }
    ++with_depth_;
    move_to_mid_exposure(rig_, shutter, point);
    if (!immature.add(point)) break;
    occupy(uv);
    ++started;
  }
  return started;
}

void PointStarter::choose_corners(const FrameImages& images, int wanted,
                                  std::vector<PointAppearance>& appearances) {
  if (wanted <= 0) return;
  spread_corners(images, usual_corners());
  const std::size_t room = appearances.capacity() - appearances.size();
  const std::size_t full = appearances.size() + std::min(room, static_cast<std::size_t>(wanted));
  PointAppearance appearance;
  for (std::int64_t i = quadtree_.next(); i >= 0 && appearances.size() < full; i = quadtree_.next()) {
    const Corner& corner = corners_[static_cast<std::size_t>(i)];
    const bool free = occupied_[cell_of(at_level_zero(corner))] == 0;
    if (!free ||
        !cut_appearance(images.left.level(corner.level), corner.u, corner.v, corner.level, appearance))
      continue;
    occupy(appearance.uv);
    appearances.push_back(appearance);
  }
}

bool PointStarter::sees_corners(const ImagePyramid& image, int wanted) {
  clear();
  corners_.clear();
  constexpr int level = 1;
  detect_corners(image.level(level), level, options_.corner_threshold, options_.min_corner_score, kBorder,
                 {cell_px_, columns_, rows_, occupied_}, corners_);
  return static_cast<int>(corners_.size()) >= wanted;
}

LostCause PointStarter::explain_missing_depth(const FrameImages& images, int wanted) {
  const cv::Mat& left = images.left.level(0);
  const cv::Mat& right = images.right.level(0);
  if (sees_corners(images.left, wanted) && !sees_corners(images.right, wanted / options_.mistake_ratio))
    return LostCause::kRightCovered;
  const int enough = std::max(wanted, options_.mistake_ratio * count_depths(left, right));
  if (count_depths(right, left) >= enough) return LostCause::kImagesSwapped;
  for (int shift = RowOffsetMeter::kMost; shift <= options_.max_row_shift; ++shift) {
    const cv::Range upper(0, left.rows - shift), lower(shift, left.rows);
    if (count_depths(left.rowRange(upper), right.rowRange(lower)) >= enough ||
        count_depths(left.rowRange(lower), right.rowRange(upper)) >= enough) {
      return LostCause::kRowsMisaligned;
    }
  }
  return LostCause::kNoTexture;
}

/// Corners of level 0 that are found in the right image.
int PointStarter::count_depths(const cv::Mat& left, const cv::Mat& right) {
  clear();
  corners_.clear();
  detect_corners(left, 0, options_.corner_threshold, options_.min_corner_score, kBorder,
                 {cell_px_, columns_, rows_, occupied_}, corners_);
  return static_cast<int>(std::count_if(corners_.begin(), corners_.end(), [&](const Corner& corner) {
    return has_right(right_from_row(left, right, rig_, corner.u, corner.v, 0, search_));
  }));
}

bool PointStarter::measure(const FrameImages& images, const Corner& corner, ImmaturePoint& point) const {
  if (!cut_appearance(images.left.level(corner.level), corner.u, corner.v, corner.level, point.appearance)) {
    return false;
  }
  const Vector2 uv = point.appearance.uv.cast<double>();
  const double u_r = right_of_corner(images, rig_, uv, corner.level, search_);
  if (!has_right(u_r)) return false;
  const double disparity = std::max(uv.x() - u_r, options_.min_disparity_px);
  const Vector3 ray = rig_.camera.unproject(uv);
  point.psi = {ray.x(), ray.y(), 1.0 / rig_.depth_from_disparity(disparity)};
  point.anchor_observation.pixel = {point.appearance.uv.x(), point.appearance.uv.y(),
                                    static_cast<float>(u_r)};
  point.anchor_observation.level = corner.level;
  return true;
}

}  // namespace twofold
