#include "structure/surface_tracks.hpp"

#include <cmath>

namespace twofold {
namespace {

bool alike(const SurfaceTrack& track, float rms, const StructureOptions& options) {
  return rms <= options.search.max_rms &&
         rms <= options.search.noise + options.search.max_rms_share * track.deviation;
}

/// H followed by a shift of the view's pixels.
Matrix3 shifted(const Matrix3& H, const Vector2& by) {
  Matrix3 result = H;
  result.topRows<2>() += by * H.row(2);
  return result;
}

/// Homography of the patch for the chosen model, its centre at the landmark's projection.
std::optional<Matrix3> warp(const SurfaceTrack& track, const PinholeCamera& camera, const Vector3& x_a,
                            const SE3& T_v_a, PatchModel model) {
  const Vector3 x_v = T_v_a * x_a;
  if (!in_front_of_camera(x_v) || !in_front_of_camera(x_a)) return std::nullopt;
  const Vector2 uv = camera.project(x_v);
  Matrix3 H = Matrix3::Identity();
  if (model == PatchModel::kPlane) {
    const auto plane = plane_homography(camera, T_v_a, x_a, Vector3::UnitZ());
    if (!plane) return std::nullopt;
    H = *plane;
  }
  // The landmark's estimate need not lie on the ray of the patch's centre.
  return shifted(H, uv - map_pixel(H, track.patch.uv));
}

float deviation_of(const SurfacePatch& patch) {
  const Eigen::Map<const Eigen::Array<float, SurfacePatch::kArea, 1>, Eigen::Aligned32> value(patch.value);
  return std::sqrt((value - value.mean()).square().mean());
}

}  // namespace

std::optional<SurfaceTrack> start_track(const FrameImages& images, const StereoPixel& z_start,
                                        const StructureOptions& options) {
  SurfaceTrack track;
  if (!cut_surface_patch(images.left.level(0), z_start.head<2>(), track.patch)) return std::nullopt;
  track.deviation = deviation_of(track.patch);
  SurfaceAlignmentOptions along_row;
  along_row.along_row = true;
  const Matrix3 H = shifted(Matrix3::Identity(), Vector2(z_start.z() - z_start.x(), 0));
  const auto right = align_surface_patch(track.patch, H, images.right, along_row);
  if (!right || !alike(track, right->rms, options)) return std::nullopt;
  track.pixel = Vector3(z_start.x(), z_start.y(), right->uv.x());
  return track;
}

std::optional<Vector3> measure_track(const SurfaceTrack& track, const FrameImages& images, const Rig& rig,
                                     const Vector3& x_a, const SE3& T_c_a, const StructureOptions& options) {
  const auto H_left = warp(track, rig.camera, x_a, T_c_a, options.patch);
  if (!H_left) return std::nullopt;
  const auto left = align_surface_patch(track.patch, *H_left, images.left, {});
  if (!left || !alike(track, left->rms, options)) return std::nullopt;

  StereoPixel z(left->uv.x(), left->uv.y(), Rig::kNoRight);
  const SE3 T_right_c(SO3(), Vector3(-rig.baseline, 0, 0));
  const auto H_right = warp(track, rig.camera, x_a, T_right_c * T_c_a, options.patch);
  if (!H_right) return z;
  // What the left image corrected holds for the right one too.
  const Vector2 corrected = left->uv - map_pixel(*H_left, track.patch.uv);
  SurfaceAlignmentOptions along_row;
  along_row.along_row = true;
  const auto right = align_surface_patch(track.patch, shifted(*H_right, corrected), images.right, along_row);
  if (right && alike(track, right->rms, options) && right->uv.x() < z.x()) z.z() = right->uv.x();
  return z;
}

}  // namespace twofold
