#include <stdexcept>

#include "camera/rectifier.hpp"
#include "io/files/calibration_file.hpp"
#include "slam/conversions.hpp"
#include "slam/frame_pixels.hpp"
#include "twofold/opencv.hpp"
#include "twofold/rectifier.hpp"

namespace twofold {
namespace {

Calibration usable_calibration(const std::filesystem::path& file, int width, int height) {
  Calibration calibration = read_calibration(file);
  if (width > 0 && height > 0) set_missing_size(width, height, &calibration);
  expect_valid(file, calibration);
  if (calibration.kind == SensorKind::kMono)
    throw std::runtime_error(file.string() +
                             ": has a single camera without depth; stereo or RGB-D is needed");
  return calibration;
}

cv::Mat usable_image(const char* name, const FrameView& frame, const ImageView& view, bool depth) {
  if (const std::string why = pixels_refusal(name, view, depth); !why.empty())
    throw std::invalid_argument(why);
  return pixels_of(view, frame.owner);
}

}  // namespace

struct TWOFOLD_HIDDEN FrameRectifier::Impl {
  explicit Impl(const Calibration& calibration)
      : rectifier(calibration), rig(to_camera_rig(rectifier.rig())) {}

  Rectifier rectifier;
  CameraRig rig;
};

FrameRectifier::FrameRectifier(const std::filesystem::path& calibration, int width, int height)
    : impl_(std::make_unique<Impl>(usable_calibration(calibration, width, height))) {}
FrameRectifier::~FrameRectifier() = default;
FrameRectifier::FrameRectifier(FrameRectifier&&) noexcept = default;
FrameRectifier& FrameRectifier::operator=(FrameRectifier&&) noexcept = default;

const CameraRig& FrameRectifier::rig() const {
  return impl_->rig;
}

FrameView FrameRectifier::rectify(const FrameView& view) const {
  const bool rgbd = impl_->rig.sensor == Sensor::kRgbd;
  Frame raw;
  raw.t_ns = view.t_ns;
  raw.left = usable_image("left", view, view.left, false);
  (rgbd ? raw.depth : raw.right) =
      rgbd ? usable_image("depth", view, view.depth, true) : usable_image("right", view, view.right, false);
  if (const std::string why = impl_->rectifier.mismatch_reason(raw); !why.empty())
    throw std::invalid_argument(why);
  Frame frame;
  impl_->rectifier.rectify(raw, frame);
  return rgbd ? rgbd_frame(frame.t_ns, frame.left, frame.depth)
              : stereo_frame(frame.t_ns, frame.left, frame.right);
}

}  // namespace twofold
