#include "tracking/loss/wide_search.hpp"

#include <cmath>
#include <random>

#include "camera/measurement.hpp"
#include "geometry/view_rotation.hpp"
#include "imaging/image_buffers.hpp"

namespace twofold {
namespace {

cv::Mat noise_image(int width, int height) {
  cv::Mat image(height, width, CV_8UC1);
  std::minstd_rand random;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(random() >> 8);
  }
  return image;
}

}  // namespace

WideSearch::WideSearch(const Rig& rig, const WideSearchOptions& options)
    : rig_(rig),
      options_(options),
      selector_(options.corners),
      consensus_(rig, static_cast<std::size_t>(options.corners.wanted), options.consensus) {
  prepare(corners_);
  of_earlier_.reserve(corners_.corners.capacity());
  of_corners_.reserve(corners_.corners.capacity());
  matches_.reserve(corners_.corners.capacity());
  for (auto* bearings : {&bearings_earlier_, &bearings_now_}) bearings->reserve(matches_.capacity());
  rotations_.reserve(1);
  // Noise has more corners than anything that is seen: all scratch has its full size after it.
  FrameImages noise;
  allocate_images(rig, noise);
  noise.left.build(noise_image(rig.camera.width, rig.camera.height));
  describer_.prepare(noise.left);
  describe(noise, corners_);
  find_nearest(corners_.corners, corners_.corners, of_earlier_, of_corners_);
}

void WideSearch::prepare(FrameCorners& corners) const {
  const auto most = static_cast<std::size_t>(options_.corners.wanted + options_.corners.levels);
  corners.corners.reserve(most);
  corners.right.reserve(most);
}

void WideSearch::look_at(const FrameImages& images) {
  now_ = &images;
  corners_.clear();
  describe(images, corners_);
}

void WideSearch::describe(const FrameImages& images, FrameCorners& corners) {
  if (corners.described) return;
  selector_.select(images.left, corners.corners);
  describer_.describe(images.left, corners.corners);
  corners.right.assign(corners.corners.size(), std::nullopt);
  corners.described = true;
}

std::optional<SE3> WideSearch::find(const FrameImages& earlier, FrameCorners& corners,
                                    const GuidedSearchOptions& search) {
  describe(earlier, corners);
  if (rig_.kind == SensorKind::kMono) {
    const auto R_now_earlier = find_rotation(corners);
    return R_now_earlier ? std::optional(SE3(*R_now_earlier, Vector3::Zero())) : std::nullopt;
  }
  match(earlier, corners, search);
  const auto agreed = consensus_.find(matches_, options_.min_agreeing);
  if (!agreed) return std::nullopt;
  std::erase_if(matches_,
                [&](const MotionObservation& match) { return !consensus_.explains(*agreed, match); });
  // Depths of one frame are poor; where the corners are seen is not.
  return optimise_motion(rig_, matches_, *agreed, {}).T_c_ref;
}

template <class Visit>
void WideSearch::for_alike(const FrameCorners& corners, Visit&& visit) {
  find_nearest(corners.corners, corners_.corners, of_earlier_, of_corners_);
  for (std::size_t i = 0; i < corners.corners.size(); ++i) {
    const NearestDescriptor& nearest = of_earlier_[i];
    if (nearest.distance > options_.max_distance) continue;
    const auto j = static_cast<std::size_t>(nearest.best);
    if (of_corners_[j].best == static_cast<int>(i)) visit(i, j);
  }
}

/// Corners that look alike and have depth in both frames.
void WideSearch::match(const FrameImages& earlier, FrameCorners& corners, const GuidedSearchOptions& search) {
  matches_.clear();
  for_alike(corners, [&](std::size_t i, std::size_t j) {
    const StereoPixel z_earlier = measure(earlier, corners, i, search);
    if (!has_right(z_earlier)) return;
    const StereoPixelF z = measure(*now_, corners_, j, search).cast<float>();
    if (!has_right(z)) return;
    matches_.push_back(observe_point(rig_, rig_.unproject(z_earlier), z, corners_.corners[j].level));
  });
}

std::optional<SO3> WideSearch::find_rotation(const FrameCorners& corners) {
  bearings_earlier_.clear();
  bearings_now_.clear();
  for_alike(corners, [&](std::size_t i, std::size_t j) {
    bearings_earlier_.push_back(rig_.camera.unproject(corners.corners[i].uv.cast<double>()));
    bearings_now_.push_back(rig_.camera.unproject(corners_.corners[j].uv.cast<double>()));
  });
  const double within = options_.turned_within * rig_.camera.width / rig_.camera.fx;
  const auto turned =
      rough_view_rotation(bearings_earlier_, bearings_now_,
                          {.threshold = within, .max_iterations = options_.max_turns}, rotations_);
  if (!turned || turned->inliers < options_.min_turned) return std::nullopt;
  return turned->R_b_a;
}

/// A corner is matched with several frames', but looked for in the right image once.
Vector3 WideSearch::measure(const FrameImages& images, FrameCorners& corners, std::size_t i,
                            const GuidedSearchOptions& search) const {
  const DescribedCorner& corner = corners.corners[i];
  const Vector2 uv = corner.uv.cast<double>();
  std::optional<double>& right = corners.right[i];
  if (!right) right = right_of_corner(images, rig_, uv, corner.level, search);
  return {uv.x(), uv.y(), *right};
}

}  // namespace twofold
