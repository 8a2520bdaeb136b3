#include <stdexcept>

#include "camera/rectifier.hpp"
#include "io/files/calibration_file.hpp"
#include "io/files/io_error.hpp"
#include "slam/conversions.hpp"
#include "slam/frame_pixels.hpp"
#include "twofold/rectifier.hpp"

namespace twofold {
namespace {

/// One file of a pair's two would give another rotation than the pair, without a word.
void expect_alone(const std::filesystem::path& file) {
  const auto folder = std::filesystem::absolute(file).parent_path();
  if (file.filename() != "sensor.yaml" || folder.filename() != "cam0") return;
  const auto other = folder.parent_path() / "cam1" / "sensor.yaml";
  if (std::filesystem::exists(other))
    throw IoError(file, "is of one camera of a pair, " + other.string() +
                            " is of the other: give their folder " + folder.parent_path().string() +
                            " (with left_only for this camera alone)");
}

Calibration usable_calibration(const std::filesystem::path& file, int width, int height, bool left_only) {
  const bool folder = std::filesystem::is_directory(file);
  if (!folder) expect_alone(file);
  Calibration calibration = read_calibration(folder && left_only ? euroc_sensor_file(file, "cam0") : file);
  if (left_only && calibration.kind != SensorKind::kMono)
    throw IoError(file, "left_only is for folders in EuRoC's layout");
  if (width > 0 && height > 0) set_missing_size(file, width, height, &calibration);
  expect_valid(file, calibration);
  return calibration;
}

/// Checks them, too.
Rectifier rectifier_of(const Calibration& calibration) {
  try {
    return Rectifier(calibration);
  } catch (const std::runtime_error& error) {
    throw std::invalid_argument(error.what());
  }
}

void expect_pixels(const char* name, const ImageView& view, bool depth) {
  if (const std::string why = pixels_refusal(name, view, depth); !why.empty())
    throw std::invalid_argument(why);
}

cv::Mat usable_image(const char* name, const FrameView& frame, const ImageView& view) {
  expect_pixels(name, view, false);
  return pixels_of(view, frame.owner);
}

}  // namespace

struct TWOFOLD_HIDDEN FrameRectifier::Impl {
  explicit Impl(Rectifier made) : rectifier(std::move(made)), rig(to_camera_rig(rectifier.rig())) {}

  Rectifier rectifier;
  CameraRig rig;
};

FrameRectifier::FrameRectifier(const std::filesystem::path& calibration, int width, int height,
                               bool left_only)
    : impl_(std::make_unique<Impl>(Rectifier(usable_calibration(calibration, width, height, left_only)))) {}
FrameRectifier::FrameRectifier(const CameraInfo& camera, Sensor sensor)
    : impl_(std::make_unique<Impl>(rectifier_of(to_calibration(camera, sensor)))) {}
FrameRectifier::FrameRectifier(const CameraInfo& left, const CameraInfo& right)
    : impl_(std::make_unique<Impl>(rectifier_of(to_calibration(left, right)))) {}
FrameRectifier::FrameRectifier(const CameraInfo& left, const CameraInfo& right, const Pose& T_right_left)
    : impl_(std::make_unique<Impl>(rectifier_of(to_calibration(left, right, T_right_left)))) {}
FrameRectifier::FrameRectifier(const BoardCalibration& calibration)
    : impl_(std::make_unique<Impl>(rectifier_of(to_calibration(calibration)))) {}
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
  raw.left = usable_image("left", view, view.left);
  if (sensor == Sensor::kRgbd) {
    expect_pixels("depth", view.depth, true);
    raw.depth = depth_pixels_of(view.depth, view.owner, impl_->rig.depth_unit);
  }
  if (sensor == Sensor::kStereo) raw.right = usable_image("right", view, view.right);
  if (const std::string why = pair_refusal(view); sensor == Sensor::kStereo && !why.empty())
    throw std::invalid_argument(why);
  if (const std::string why = impl_->rectifier.mismatch_reason(raw); !why.empty())
    throw std::invalid_argument(why);
  Frame frame;
  impl_->rectifier.rectify(raw, frame);
  return view_of(sensor, frame);
}

FrameView FrameRectifier::rectify_in_colour(const FrameView& raw) const {
  const FrameView frame = rectify(raw);
  if (raw.left.format == ImageFormat::kGrey8) return frame;
  return with_colour(frame, impl_->rectifier.rectified_left(bgr_pixels_of(raw.left)));
}

}  // namespace twofold
