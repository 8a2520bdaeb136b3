#include "slam/frame_intake.hpp"

#include <fmt/format.h>

#include "slam/frame_pixels.hpp"

namespace twofold {
namespace {

std::string image_refusal(const char* name, const ImageView& view, const PinholeCamera& camera, bool depth) {
  if (view.data != nullptr && (view.width != camera.width || view.height != camera.height))
    return fmt::format("the {} image is {}x{}, the rig's are {}x{}", name, view.width, view.height,
                       camera.width, camera.height);
  return pixels_refusal(name, view, depth);
}

}  // namespace

std::string FrameIntake::refusal(const FrameView& view) const {
  if (next_index_ > 0 && view.t_ns <= last_t_ns_)
    return fmt::format("time does not grow: the frame was taken at {} ns, the one before at {} ns", view.t_ns,
                       last_t_ns_);
  if (std::string why = image_refusal("left", view.left, rig_.camera, false); !why.empty()) return why;
  switch (rig_.kind) {
    case SensorKind::kStereo: {
      std::string why = image_refusal("right", view.right, rig_.camera, false);
      return why.empty() ? pair_refusal(view) : why;
    }
    case SensorKind::kRgbd:
      return image_refusal("depth", view.depth, rig_.camera, true);
    case SensorKind::kMono:
      break;
  }
  const bool alone = view.right.data == nullptr && view.depth.data == nullptr;
  return alone ? "" : "the rig is one camera (Sensor::kMono): the frame must have a left image only";
}

Frame FrameIntake::take(const FrameView& view) {
  Frame frame;
  frame.t_ns = view.t_ns;
  frame.left = pixels_of(view.left, view.owner);
  if (rig_.kind == SensorKind::kRgbd) frame.depth = depth_pixels_of(view.depth, view.owner, rig_.depth_unit);
  if (rig_.kind == SensorKind::kStereo) frame.right = pixels_of(view.right, view.owner);
  frame.index = skip(view);
  return frame;
}

std::int64_t FrameIntake::skip(const FrameView& view) {
  last_t_ns_ = view.t_ns;
  return next_index_++;
}

}  // namespace twofold
