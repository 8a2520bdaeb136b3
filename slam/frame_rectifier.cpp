#include <stdexcept>

#include "camera/rectifier.hpp"
#include "io/files/calibration_file.hpp"
#include "slam/conversions.hpp"
#include "slam/frame_pixels.hpp"
#include "twofold/rectifier.hpp"

namespace twofold {
namespace {

Calibration usable_calibration(const std::filesystem::path& file, int width, int height) {
  Calibration calibration = read_calibration(file);
  if (width > 0 && height > 0) set_missing_size(width, height, &calibration);
  expect_valid(file, calibration);
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

Pose FrameRectifier::T_rectified_raw() const {
  return to_pose(SE3(impl_->rectifier.R_rectified_left(), Vector3::Zero()));
}

FrameView FrameRectifier::rectify(const FrameView& view) const {
  const Sensor sensor = impl_->rig.sensor;
  Frame raw;
  raw.t_ns = view.t_ns;
  raw.left = usable_image("left", view, view.left, false);
  if (sensor == Sensor::kRgbd) raw.depth = usable_image("depth", view, view.depth, true);
  if (sensor == Sensor::kStereo) raw.right = usable_image("right", view, view.right, false);
  if (const std::string why = impl_->rectifier.mismatch_reason(raw); !why.empty())
    throw std::invalid_argument(why);
  Frame frame;
  impl_->rectifier.rectify(raw, frame);
  return view_of(sensor, frame);
}

}  // namespace twofold
