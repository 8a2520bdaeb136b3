#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "apps/twofold/surface/object_source.hpp"
#include "apps/twofold/surface/surface_output.hpp"
#include "evaluation/trajectory.hpp"
#include "geometry/triangle_mesh.hpp"
#include "surface/options.hpp"
#include "surface/turntable_axis.hpp"

namespace twofold {

/// An upright box around the object, in the map's frame.
struct ObjectBox {
  Vector3 centre{0, 0, 0};
  Vector3 size{0, 0, 0};  ///< along its axes [m]
  std::array<Vector3, 3> axes{
      Vector3::UnitX(), Vector3::UnitY(),
      Vector3::UnitZ()};  ///< unit; the third is up, the first the longer of the others
};

/// What the frames of an object make, along their poses in the final map.
struct ObjectModel {
  TriangleMesh mesh;  ///< in the map's frame: the object stands still in it
  ObjectBox box;
  Vector3 up{0, 0, 1};  ///< normal of the support plane
  std::optional<TurntableAxis>
      axis;  ///< however much the camera's way deviates from it; nothing where it has no rate
  SurfaceFigures figures;
};

/// Fuses the kept frames that have a pose. Pieces of the mesh that have a fiftieth of its triangles are kept,
/// but for those that stand beside the largest one. options must be valid, with depth_noise.
/// @param poses  T_w_c of frames, ascending in time
[[nodiscard]] ObjectModel build_object(const ObjectSource& source, const Trajectory& poses,
                                       const SurfaceOptions& options);

/// Between the directions in which the cameras see a position, the largest angle there is [rad].
[[nodiscard]] double widest_view_angle(const Vector3& x_w, const Trajectory& poses);

/// Four views of the object, from a little above, a quarter turn from each to the next. CV_8UC3.
[[nodiscard]] cv::Mat draw_object(const ObjectModel& model);

/// The smallest upright box; the mesh must not be empty.
[[nodiscard]] ObjectBox box_around(const TriangleMesh& mesh, const Vector3& up);

}  // namespace twofold
