#pragma once

#include <algorithm>
#include <cstdint>

#include "geometry/se3.hpp"
#include "surface/depth_view.hpp"
#include "surface/options.hpp"
#include "surface/voxel_block.hpp"

namespace twofold {

/// What is nearer in front of the camera is not seen [m].
constexpr float kLeastDepth = 0.05f;

/// What fusion knows of the sensor and the view, as floats.
struct FusionView {
  Eigen::Matrix3f R_c_v;
  float fx, fy, cx, cy, width, height;
  std::int32_t stride;
  float voxel, truncation, noise, max_weight;

  FusionView(const DepthView& view, const SurfaceOptions& options, const SE3& T_c_v)
      : R_c_v(T_c_v.rotation().cast<float>()),
        fx(static_cast<float>(view.camera.fx)),
        fy(static_cast<float>(view.camera.fy)),
        cx(static_cast<float>(view.camera.cx)),
        cy(static_cast<float>(view.camera.cy)),
        width(static_cast<float>(view.camera.width)),
        height(static_cast<float>(view.camera.height)),
        stride(view.camera.width),
        voxel(static_cast<float>(options.voxel)),
        truncation(static_cast<float>(options.truncation * options.voxel)),
        noise(static_cast<float>(options.depth_noise)),
        max_weight(static_cast<float>(options.max_weight)) {}

  /// Distances are kept up to so much [m] for readings at depth z [m], whose sigma is noise z^2.
  [[nodiscard]] float truncation_at(float z) const {
    return std::min(std::max(truncation, 3 * noise * z * z), kMostDistanceVoxels * voxel);
  }
};

}  // namespace twofold
