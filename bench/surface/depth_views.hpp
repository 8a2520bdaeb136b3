#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "fixtures/rendered_scene.hpp"
#include "surface/depth_view.hpp"

namespace twofold {

inline constexpr int kViews = 8;

/// A camera that moves by 5 cm a view and turns, before a wall and a floor 1 to 2 m away.
struct DepthViews {
  DepthViews() {
    testing::RenderedScene scene(rig, {1.2, 0.9, 1.4}, 5);
    for (int n = 0; n < kViews; ++n) {
      T_c_w.push_back(SE3(SO3::exp(Vector3(0.1, 0.04 * n, 0)), Vector3(0.05 * n, 0, 0)));
      depth.push_back(scene.render_depth(T_c_w.back()));
      colour.emplace_back(depth.back().size(), CV_8UC3, cv::Scalar(30, 90, 200));
      views.push_back(make_depth_view(rig, depth.back(), colour.back()));
    }
  }
  Rig rig = [] {
    Rig depth_rig = testing::test_rig(SensorKind::kRgbd);
    depth_rig.camera.fx = depth_rig.camera.fy = 420;
    return depth_rig;
  }();
  std::vector<SE3> T_c_w;
  std::vector<cv::Mat> depth, colour;
  std::vector<DepthView> views;
};

inline const DepthViews& depth_views() {
  static const DepthViews kAll;
  return kAll;
}

}  // namespace twofold
