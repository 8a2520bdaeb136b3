#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "camera/pinhole.hpp"
#include "geometry/se3.hpp"
#include "synthetic/scene.hpp"

namespace twofold::synthetic {

/// What a noise-free camera sees.
struct View {
  cv::Mat intensity;      ///< CV_32FC1, grey levels
  cv::Mat inverse_depth;  ///< CV_32FC1, 1/z of the surface through the pixel's centre [1/m]; 0 for the sky
};

/// What a camera is before at one instant.
struct Instant {
  SE3 T_w_c;
  std::vector<Quad> extra;  ///< moving objects; their textures belong to the scene
};

/// Ray caster with exact depth and filtered textures.
///
/// Each pixel's ray is intersected with the primitives whose outline touches its tile; the hit is shaded
/// through the texture footprint of the pixel (from the surface's tangent plane). Pixels at the rim of a
/// primitive are replaced by the mean of eight sub-pixel rays. Rows of tiles run in parallel (TBB); the
/// result does not depend on that.
class Renderer {
 public:
  /// scene must outlive the renderer.
  explicit Renderer(const Scene& scene) : scene_(&scene) {}

  /// extra: primitives of this instant only (moving objects); their textures belong to the scene.
  [[nodiscard]] View render(const PinholeCamera& camera, const SE3& T_w_c,
                            const std::vector<Quad>& extra = {}) const;

  /// As a rolling shutter sees it: each row at an instant of its own. Takes several times as long.
  /// @param instant_of  is called from several threads
  [[nodiscard]] View render_rows(const PinholeCamera& camera,
                                 const std::function<Instant(int row)>& instant_of) const;

 private:
  const Scene* scene_;
};

}  // namespace twofold::synthetic
