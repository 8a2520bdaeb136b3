// What the tracker does with pixels, on a rendered stereo pair of 640 x 480.
#include <benchmark/benchmark.h>

#include <vector>

#include "fixtures/rendered_scene.hpp"
#include "geometry/inverse_depth.hpp"
#include "imaging/fast_corners.hpp"
#include "imaging/guided_search.hpp"

namespace twofold {
namespace {

/// Two views of a room, a frame's motion apart, and the corners of the first with their true depth.
struct Views {
  struct Point {
    PointAppearance appearance;
    Vector3 psi;
  };

  Views() {
    testing::RenderedScene scene(rig, {3, 2, 5}, 21);
    scene.render(SE3(), 2, first);
    scene.render(T_second_first, 2, second);
    occupied.resize(static_cast<std::size_t>(rig.camera.width / kCell * (rig.camera.height / kCell)), 0);
    corners.reserve(4000);
    for (int level = 0; level < 3; ++level)
      detect_corners(first.left.level(level), level, 10, 12, 12, grid(), corners);
    for (const Corner& corner : corners) {
      Point point;
      if (!cut_appearance(first.left.level(corner.level), corner.u, corner.v, corner.level, point.appearance))
        continue;
      const Vector2 uv = point.appearance.uv.cast<double>();
      const Vector3 ray = rig.camera.unproject(uv);
      point.psi = {ray.x(), ray.y(), 1.0 / scene.depth(SE3(), uv)};
      points.push_back(point);
    }
  }
  [[nodiscard]] CellGrid grid() const {
    return {kCell, rig.camera.width / kCell, rig.camera.height / kCell, occupied};
  }

  static constexpr int kCell = 28;
  Rig rig = testing::test_rig(SensorKind::kStereo);
  SE3 T_second_first{SO3::exp(Vector3(0, 0.01, 0)), Vector3(0.02, 0, -0.03)};
  FrameImages first, second;
  std::vector<std::uint8_t> occupied;
  std::vector<Corner> corners;
  std::vector<Point> points;
};

const Views& views() {
  static const Views both;
  return both;
}

void pyramid(benchmark::State& state) {
  const cv::Mat image = views().first.left.level(0);
  ImagePyramid pyramid;
  for (auto _ : state) pyramid.build(image);
}
BENCHMARK(pyramid)->Unit(benchmark::kMicrosecond);

void fast_corners(benchmark::State& state) {
  const int level = static_cast<int>(state.range(0));
  const cv::Mat& image = views().first.left.level(level);
  std::vector<Corner> corners;
  corners.reserve(4000);
  for (auto _ : state) {
    corners.clear();
    detect_corners(image, level, 10, 12, 12, views().grid(), corners);
  }
  state.counters["corners"] = static_cast<double>(corners.size());
}
BENCHMARK(fast_corners)->ArgName("level")->DenseRange(0, 2)->Unit(benchmark::kMicrosecond);

/// One point, left and right image: warp, whole-pixel search, sub-pixel refinement.
void patch_search(benchmark::State& state) {
  const GuidedSearchOptions options;
  const Views& both = views();
  std::size_t n = 0;
  std::size_t found = 0;
  for (auto _ : state) {
    const Views::Point& point = both.points[n++ % both.points.size()];
    const auto match =
        find_point(both.second, both.rig, point.appearance, point.psi, both.T_second_first, options);
    found += match.has_value();
  }
  state.counters["found_share"] = static_cast<double>(found) / static_cast<double>(state.iterations());
}
BENCHMARK(patch_search)->Unit(benchmark::kMicrosecond);

/// Depth of a new point: the whole row is searched.
void row_search(benchmark::State& state) {
  const GuidedSearchOptions options;
  const Views& both = views();
  std::size_t n = 0;
  for (auto _ : state) {
    const Corner& corner = both.corners[n++ % both.corners.size()];
    benchmark::DoNotOptimize(right_from_row(both.first, both.rig, corner.u, corner.v, corner.level, options));
  }
}
BENCHMARK(row_search)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace twofold
