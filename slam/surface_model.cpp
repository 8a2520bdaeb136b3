#include "twofold/surface.hpp"

#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "base/option_check.hpp"
#include "slam/conversions.hpp"
#include "slam/distance_field.hpp"
#include "slam/frame_pixels.hpp"
#include "slam/surface_pieces.hpp"
#include "surface/free_space/free_space.hpp"
#include "surface/meshing.hpp"
#include "surface/stereo/stereo_depth.hpp"

namespace twofold {
namespace {

constexpr double kFarthest = 1e5;     // [m]
constexpr double kUnitLength = 1e-3;  // that a quaternion's squared length may differ from one, as of a file

Rig depth_rig(const CameraRig& rig) {
  Rig inside = to_rig(rig);
  if (const std::string why = no_surface_reason(inside); !why.empty())
    throw std::invalid_argument("the rig " + why);
  return inside;
}

SurfaceOptions surface_options(const Rig& rig, const SurfaceModelOptions& options) {
  if (const std::string why = options.invalid_reason(); !why.empty())
    throw std::invalid_argument("options." + why);
  SurfaceOptions surface;
  surface.voxel = options.voxel;
  surface.max_depth = options.max_depth;
  surface.depth_noise = usual_depth_noise(rig);
  return surface;
}

void expect_pixels(const char* name, const ImageView& view, bool depth) {
  if (const std::string refusal = pixels_refusal(name, view, depth); !refusal.empty())
    throw std::invalid_argument(refusal);
}

/// As fusion takes it.
cv::Mat colour_of(const ImageView& view) {
  const bool is_grey = view.data == nullptr || view.format == ImageFormat::kGrey8;
  return is_grey ? pixels_of(view, nullptr) : bgr_pixels_of(view);
}

}  // namespace

std::string SurfaceModelOptions::invalid_reason() const {
  return OptionCheck()
      .within("voxel", voxel, 1e-4, 10)
      .at_least("max_depth", max_depth, 0)
      .at_least("max_free_depth", max_free_depth, 0)
      .above("nearest_stereo", nearest_stereo, 0)
      .reason();
}

struct SurfaceModel::Impl {
  Impl(const Rig& its_rig, const SurfaceModelOptions& its_options)
      : rig(its_rig),
        options(its_options),
        volume(surface_options(its_rig, its_options)),
        free(volume.options(), its_options.max_free_depth) {}

  Rig rig;
  SurfaceModelOptions options;
  SurfaceVolume volume;
  FreeSpace free;
  MeshPieces pieces = {};
};

SurfaceModel::SurfaceModel(const CameraRig& rig, const SurfaceModelOptions& options)
    : impl_(new Impl(depth_rig(rig), options)) {}
SurfaceModel::~SurfaceModel() = default;
SurfaceModel::SurfaceModel(SurfaceModel&&) noexcept = default;
SurfaceModel& SurfaceModel::operator=(SurfaceModel&&) noexcept = default;

int SurfaceModel::add(const FrameView& frame, const Pose& T_world_camera) {
  const Rig& rig = impl_->rig;
  const auto& q = T_world_camera.q;
  if (!(std::abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1) < kUnitLength))
    throw std::invalid_argument("T_world_camera.q is no unit quaternion");
  const SE3 T_w_c = to_se3(T_world_camera);
  if (!(T_w_c.translation().norm() < kFarthest) || !T_w_c.matrix().allFinite())
    throw std::invalid_argument("T_world_camera is not finite, or farther than 100 km from the origin");
  expect_pixels("left", frame.left, false);
  cv::Mat depth;
  if (rig.kind == SensorKind::kStereo) {
    expect_pixels("right", frame.right, false);
    const cv::Mat left = pixels_of(frame.left, nullptr);
    const cv::Mat right = pixels_of(frame.right, nullptr);
    const cv::Size size(rig.camera.width, rig.camera.height);
    if (left.size() != size || right.size() != size)
      throw std::invalid_argument("left and right image must both be of the rig's size");
    depth = stereo_depth(rig, left, right, impl_->options.nearest_stereo);
  } else {
    expect_pixels("depth", frame.depth, true);
    depth = pixels_of(frame.depth, frame.owner);
  }
  const cv::Mat colour = colour_of(frame.left);
  if (const std::string defect = depth_defect(rig, depth, colour); !defect.empty())
    throw std::invalid_argument(defect);
  const DepthView view = make_depth_view(rig, depth, colour);
  const int readings = cv::countNonZero(view.depth);
  if (readings == 0) return 0;
  impl_->volume.fuse(view, T_w_c.inverse());
  impl_->free.add(view, T_w_c.inverse());
  return readings;
}

void SurfaceModel::clear() {
  impl_->volume.clear();
  impl_->free.clear();
}

SpacePoint SurfaceModel::at(const std::array<double, 3>& p_world) const {
  return space_point(impl_->volume, impl_->free, p_world);
}

DistanceField SurfaceModel::distances(const DistanceBox& box) const {
  if (const std::string why = box.invalid_reason(); !why.empty()) throw std::invalid_argument("box." + why);
  return distance_field(impl_->volume, impl_->free, box);
}

SurfaceMesh SurfaceModel::mesh() const {
  return to_surface_mesh(extract_mesh(impl_->volume));
}

SurfaceChanges SurfaceModel::mesh_changes(std::uint64_t since) {
  impl_->pieces.update(impl_->volume);
  return {impl_->pieces.revision(), kBlockEdge * impl_->options.voxel, surface_pieces(impl_->pieces, since)};
}

std::size_t SurfaceModel::memory_bytes() const {
  return impl_->volume.bytes() + impl_->free.bytes() + impl_->pieces.bytes();
}

}  // namespace twofold
