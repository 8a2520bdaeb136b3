#include "surface/options.hpp"

#include <fmt/format.h>

#include "base/option_check.hpp"

namespace twofold {
namespace {

constexpr double kMostDepthNoise = 1;  // [1/m]: at a metre, as much as the depth itself

}  // namespace

std::string SurfaceOptions::invalid_reason() const {
  return OptionCheck()
      .within("voxel", voxel, 1e-4, 10)
      .within("truncation", truncation, 2, 20)
      .at_least("max_depth", max_depth, 0)
      .within("depth_noise", depth_noise, 0, kMostDepthNoise)
      .above("min_weight", min_weight, 0)
      .at_least("max_weight", max_weight, 1)
      .at_least("min_triangles", min_triangles, 0)
      .reason();
}

double usual_depth_noise(const Rig& rig) {
  constexpr double kStructuredLight = 1.425e-3;
  constexpr double kDisparity = 0.12;  // [px]
  return rig.kind == SensorKind::kRgbd ? kStructuredLight : kDisparity / (rig.camera.fx * rig.baseline);
}

std::string no_surface_reason(const Rig& rig) {
  if (rig.kind == SensorKind::kMono)
    return "is one camera, which gives no depth: a surface needs stereo or RGB-D";
  if (usual_depth_noise(rig) <= kMostDepthNoise) return {};
  return fmt::format("has a baseline of {:g} m, with which depth is noise alone: is that in metres?",
                     rig.baseline);
}

}  // namespace twofold
