#include "tracking/wide_search.hpp"

#include <cmath>
#include <random>

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
  of_earlier_.reserve(corners_.capacity());
  of_corners_.reserve(corners_.capacity());
  matches_.reserve(corners_.capacity());
  // Noise has more corners than anything that is seen: all scratch has its full size after it.
  FrameImages noise;
  allocate_images(rig, noise);
  noise.left.build(noise_image(rig.camera.width, rig.camera.height));
  selector_.select(noise.left, corners_);
  describer_.prepare(noise.left);
  describer_.describe(noise.left, corners_);
  find_nearest(corners_, corners_, of_earlier_, of_corners_);
}

void WideSearch::prepare(std::vector<DescribedCorner>& corners) const {
  corners.reserve(static_cast<std::size_t>(options_.corners.wanted + options_.corners.levels));
}

void WideSearch::look_at(const FrameImages& images) {
  now_ = &images;
  describe(images, corners_);
}

void WideSearch::describe(const FrameImages& images, std::vector<DescribedCorner>& corners) {
  selector_.select(images.left, corners);
  describer_.describe(images.left, corners);
}

std::optional<SE3> WideSearch::find(const FrameImages& earlier, std::vector<DescribedCorner>& corners,
                                    const GuidedSearchOptions& search) {
  if (corners.empty()) describe(earlier, corners);
  match(earlier, corners, search);
  const auto agreed = consensus_.find(matches_, options_.min_agreeing);
  if (!agreed) return std::nullopt;
  std::erase_if(matches_,
                [&](const MotionObservation& match) { return !consensus_.explains(*agreed, match); });
  // Depths of one frame are poor; where the corners are seen is not.
  return optimise_motion(rig_, matches_, *agreed, {}).T_c_ref;
}

/// Corners that look alike, each more than any other, and have depth in both frames.
void WideSearch::match(const FrameImages& earlier, std::span<const DescribedCorner> corners,
                       const GuidedSearchOptions& search) {
  find_nearest(corners, corners_, of_earlier_, of_corners_);
  matches_.clear();
  const auto measure = [&](const FrameImages& images, const DescribedCorner& corner) {
    const Vector2 uv = corner.uv.cast<double>();
    return Vector3(uv.x(), uv.y(), right_of_corner(images, rig_, uv, corner.level, search));
  };
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const NearestDescriptor& nearest = of_earlier_[i];
    if (nearest.distance > options_.max_distance) continue;
    const auto j = static_cast<std::size_t>(nearest.best);
    if (of_corners_[j].best != static_cast<int>(i)) continue;
    const Vector3 z_earlier = measure(earlier, corners[i]);
    if (std::isnan(z_earlier.z())) continue;
    const Eigen::Vector3f z = measure(*now_, corners_[j]).cast<float>();
    if (std::isnan(z.z())) continue;
    matches_.push_back({rig_.unproject(z_earlier), z, rig_.information(z, corners_[j].level)});
  }
}

}  // namespace twofold
