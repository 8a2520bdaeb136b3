#include "slam/depth_frame.hpp"

#include <algorithm>
#include <stdexcept>

#include "imaging/row_offset.hpp"
#include "slam/frame_pixels.hpp"
#include "surface/depth_view.hpp"
#include "surface/stereo/stereo_depth.hpp"

namespace twofold {
namespace {

void expect_pixels(const char* name, const ImageView& view, bool depth) {
  if (const std::string refusal = pixels_refusal(name, view, depth); !refusal.empty())
    throw std::invalid_argument(refusal);
}

/// As fusion takes it.
cv::Mat colour_of(const ImageView& view) {
  const bool is_grey = view.data == nullptr || view.format == ImageFormat::kGrey8;
  return is_grey ? pixels_of(view, nullptr) : bgr_pixels_of(view);
}

cv::Mat depth_of_pair(const Rig& rig, const FrameView& frame, const PairMatching& matching) {
  expect_pixels("right", frame.right, false);
  const cv::Mat left = pixels_of(frame.left, nullptr);
  const cv::Mat right = pixels_of(frame.right, nullptr);
  const cv::Size size(rig.camera.width, rig.camera.height);
  if (left.size() != size || right.size() != size)
    throw std::invalid_argument("left and right image must both be of the rig's size");
  // What is nearer than depth_min, and cut later, still has to be matched, lest it be taken for farther.
  const double nearest =
      matching.min_depth > 0 ? matching.min_depth : std::min(rig.depth_min, kNearestStereo);
  return stereo_depth(rig, left, without_row_offset(right, matching.row_offset), nearest);
}

}  // namespace

Rig expect_depth(const Rig& rig) {
  if (const std::string why = no_surface_reason(rig); !why.empty())
    throw std::invalid_argument("the rig " + why);
  return rig;
}

SurfaceOptions surface_options(const Rig& rig, const SurfaceModelOptions& options) {
  if (const std::string why = options.invalid_reason(); !why.empty())
    throw std::invalid_argument("options." + why);
  SurfaceOptions surface;
  surface.voxel = options.voxel_size;
  surface.max_depth = options.max_depth;
  surface.depth_noise = usual_depth_noise(rig);
  return surface;
}

DepthFrame depth_frame(const Rig& rig, const FrameView& frame, const PairMatching& matching) {
  expect_pixels("left", frame.left, false);
  DepthFrame images;
  if (rig.kind == SensorKind::kStereo) {
    images.depth = depth_of_pair(rig, frame, matching);
  } else {
    expect_pixels("depth", frame.depth, true);
    images.depth = depth_pixels_of(frame.depth, frame.owner, rig.depth_unit);
  }
  images.colour = colour_of(frame.left);
  if (const std::string defect = depth_defect(rig, images.depth, images.colour); !defect.empty())
    throw std::invalid_argument(defect);
  return images;
}

}  // namespace twofold
