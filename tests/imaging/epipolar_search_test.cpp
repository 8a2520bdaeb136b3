#include "imaging/epipolar_search.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "fixtures/rendered_scene.hpp"
#include "geometry/inverse_depth.hpp"
#include "imaging/fast_corners.hpp"
#include "imaging/patch.hpp"

namespace twofold {
namespace {

using testing::RenderedScene;
using testing::test_rig;

/// Corners of `images` on level 0, one a cell.
std::vector<PointAppearance> corners_of(const Rig& rig, const FrameImages& images) {
  std::vector<Corner> corners;
  corners.reserve(1000);
  const int columns = rig.camera.width / 32, rows = rig.camera.height / 32;
  const std::vector<std::uint8_t> free(static_cast<std::size_t>(columns * rows), 0);
  detect_corners(images.left.level(0), 0, 10, 15, 12, {32, columns, rows, free}, corners);
  std::vector<PointAppearance> appearances(corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i)
    EXPECT_TRUE(cut_appearance(images.left.level(0), corners[i].u, corners[i].v, 0, appearances[i]));
  return appearances;
}

TEST(EpipolarSearch, FindsPointsOfUnknownDepthWhereTheyAre) {
  const Rig rig = test_rig(SensorKind::kMono);
  RenderedScene scene(rig, {3, 2, 5}, 21);
  FrameImages anchor, view;
  scene.render(SE3(), 2, anchor);
  for (const Vector3& t : {Vector3(-0.2, 0, 0), Vector3(0.05, 0.1, 0.05), Vector3(0, 0, -0.5)}) {
    const SE3 T_c_a(SO3::exp(Vector3(0.01, -0.02, 0.03)), t);
    scene.render(T_c_a, 2, view);
    int inside = 0, found = 0, wrong = 0;
    for (const PointAppearance& appearance : corners_of(rig, anchor)) {
      const Vector2 uv = appearance.uv.cast<double>();
      const Vector3 ray = rig.camera.unproject(uv);
      const Vector2 truth = rig.camera.project(T_c_a * (ray * scene.depth(SE3(), uv)));
      if (!rig.camera.contains(truth, 20)) continue;
      ++inside;
      const auto stretch = epipolar_stretch(rig.camera, appearance, ray, T_c_a, {0, 1, 0.25});
      if (!stretch) continue;
      const auto match = find_along(view.left, appearance, *stretch, {});
      if (!match) continue;
      ++found;
      wrong += (match->pixel.head<2>() - truth).norm() > 1.0 * std::ldexp(1.0, match->level);
    }
    EXPECT_GT(found, 0.6 * inside) << t.transpose();
    EXPECT_LE(wrong, 0.05 * found) << t.transpose();
  }
}

TEST(EpipolarSearch, RefusesWhatRepeatsAlongTheLine) {
  const Rig rig = test_rig(SensorKind::kMono);
  cv::Mat bars(rig.camera.height, rig.camera.width, CV_8UC1);
  for (int v = 0; v < bars.rows; ++v) {
    for (int u = 0; u < bars.cols; ++u) bars.at<std::uint8_t>(v, u) = (u / 8 + v / 40) % 2 == 0 ? 60 : 180;
  }
  FrameImages images;
  images.left.build(bars);
  PointAppearance appearance;
  ASSERT_TRUE(cut_appearance(images.left.level(0), 320, 240, 0, appearance));
  const Vector3 ray = rig.camera.unproject({320, 240});
  const SE3 T_c_a(SO3(), Vector3(-0.1, 0, 0));
  const auto wide = epipolar_stretch(rig.camera, appearance, ray, T_c_a, {0, 1, 0.25});
  ASSERT_TRUE(wide);
  EXPECT_GT(wide->length_px(), 40);
  EXPECT_FALSE(find_along(images.left, appearance, *wide, {}));
  // Where the range leaves but one bar it is not ambiguous.
  const auto narrow = epipolar_stretch(rig.camera, appearance, ray, T_c_a, {0, 0.05, 0.01});
  ASSERT_TRUE(narrow);
  EXPECT_TRUE(find_along(images.left, appearance, *narrow, {}));
}

TEST(EpipolarSearch, EndsBeforeThePlaneOfTheCamera) {
  // The camera moves forward past near points: their projections run to infinity.
  const Rig rig = test_rig(SensorKind::kMono);
  const SE3 T_c_a(SO3(), Vector3(0, 0, -1));
  PointAppearance appearance;
  const auto stretch =
      epipolar_stretch(rig.camera, appearance, rig.camera.unproject({400, 300}), T_c_a, {0, 5, 0.1});
  ASSERT_TRUE(stretch);
  EXPECT_TRUE(std::isfinite(stretch->length_px()));
  EXPECT_LT(stretch->length_px(), 1000);
}

}  // namespace
}  // namespace twofold
