#include "twofold/surface.hpp"

#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "base/option_check.hpp"
#include "slam/conversions.hpp"
#include "slam/depth_frame.hpp"
#include "slam/distance_field.hpp"
#include "slam/surface_pieces.hpp"
#include "surface/free_space/free_space.hpp"
#include "surface/meshing.hpp"

namespace twofold {
namespace {

constexpr double kFarthest = 1e5;     // [m]
constexpr double kUnitLength = 1e-3;  // that a quaternion's squared length may differ from one, as of a file

}  // namespace

std::string SurfaceModelOptions::invalid_reason() const {
  return OptionCheck()
      .within("voxel_size", voxel_size, 1e-4, 10)
      .at_least("max_depth", max_depth, 0)
      .at_least("max_free_depth", max_free_depth, 0)
      .at_least("min_stereo_depth", min_stereo_depth, 0)
      .reason();
}

struct TWOFOLD_HIDDEN SurfaceModel::Impl {
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
    : impl_(new Impl(expect_depth(to_rig(rig)), options)) {}
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
  const DepthFrame images = depth_frame(rig, frame, {.min_depth = impl_->options.min_stereo_depth});
  const DepthView view = make_depth_view(rig, images.depth, images.colour);
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
  return {impl_->pieces.revision(), kBlockEdge * impl_->options.voxel_size,
          surface_pieces(impl_->pieces, since)};
}

std::size_t SurfaceModel::memory_bytes() const {
  return impl_->volume.bytes() + impl_->free.bytes() + impl_->pieces.bytes();
}

}  // namespace twofold
