#pragma once

#include <cstdint>
#include <optional>

#include "camera/measurement.hpp"
#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "imaging/plane_warp.hpp"
#include "structure/options.hpp"

namespace twofold {

/// A feature followed over frames by the patch it was first seen as.
struct SurfaceTrack {
  std::int64_t id = 0;
  std::int64_t anchor_frame = 0;  ///< the frame the patch was cut from
  SurfacePatch patch;
  float deviation = 0;  ///< of the patch's grey values
  StereoPixel pixel;    ///< where it was seen last
};

/// A track that starts at a stereo feature: cuts its patch and aligns it with the right image; nothing when
/// it reaches over a border or is not found.
[[nodiscard]] std::optional<SurfaceTrack> start_track(const FrameImages& images, const StereoPixel& z_start,
                                                      const StructureOptions& options);

/// Measures the track's landmark in a view.
///
/// @param x_a    landmark in the anchor's frame, as estimated now [m]
/// @param T_c_a  pose of the view against the anchor, as estimated now
/// @return without a right coordinate when the right image does not show it; nothing when it was not found.
[[nodiscard]] std::optional<Vector3> measure_track(const SurfaceTrack& track, const FrameImages& images,
                                                   const Rig& rig, const Vector3& x_a, const SE3& T_c_a,
                                                   const StructureOptions& options);

}  // namespace twofold
