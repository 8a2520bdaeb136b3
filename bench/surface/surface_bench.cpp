// What a depth image of 640 x 480 costs: the room of fixtures/rendered_scene.hpp, seen from a desk's
// distance.
#include <benchmark/benchmark.h>

#include "fixtures/rendered_scene.hpp"
#include "surface/meshing.hpp"
#include "surface/packed_depth.hpp"
#include "surface/volume.hpp"

namespace twofold {
namespace {

constexpr int kViews = 8;

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

const DepthViews& depth_views() {
  static const DepthViews kAll;
  return kAll;
}

SurfaceOptions options_of(const benchmark::State& state) {
  SurfaceOptions options;
  options.voxel = 1e-3 * static_cast<double>(state.range(0));
  options.depth_noise = 1.425e-3;
  return options;
}

void prepare_depth(benchmark::State& state) {
  const DepthViews& all = depth_views();
  std::size_t n = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(make_depth_view(all.rig, all.depth[n % kViews], all.colour[n % kViews]));
    ++n;
  }
}
BENCHMARK(prepare_depth)->Unit(benchmark::kMillisecond);

/// Into a volume that has seen all of it before, as most of a keyframe's depth.
void fuse_depth(benchmark::State& state) {
  const DepthViews& all = depth_views();
  SurfaceVolume volume(options_of(state));
  for (std::size_t n = 0; n < kViews; ++n) volume.fuse(all.views[n], all.T_c_w[n]);
  std::size_t n = 0;
  for (auto _ : state) {
    volume.fuse(all.views[n % kViews], all.T_c_w[n % kViews]);
    ++n;
  }
  state.counters["blocks"] = static_cast<double>(volume.blocks().size());
}
BENCHMARK(fuse_depth)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond);

void mesh_of_volume(benchmark::State& state) {
  const DepthViews& all = depth_views();
  SurfaceVolume volume(options_of(state));
  for (std::size_t n = 0; n < kViews; ++n) volume.fuse(all.views[n], all.T_c_w[n]);
  for (auto _ : state) benchmark::DoNotOptimize(extract_mesh(volume));
}
BENCHMARK(mesh_of_volume)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond);

void pack_and_unpack_depth(benchmark::State& state) {
  const cv::Mat& depth = depth_views().depth.front();
  for (auto _ : state) benchmark::DoNotOptimize(PackedDepth(depth).unpacked());
}
BENCHMARK(pack_and_unpack_depth)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace twofold
