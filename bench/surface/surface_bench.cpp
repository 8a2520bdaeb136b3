// What a depth image of 640 x 480 costs: the room of fixtures/rendered_scene.hpp, seen from a desk's
// distance.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>

#include "bench/surface/depth_views.hpp"
#include "surface/composition.hpp"
#include "surface/meshing.hpp"
#include "surface/packed_images.hpp"
#include "surface/volume.hpp"

namespace twofold {
namespace {

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

/// As fuse_depth, from the image that the sensor gives on.
void prepare_and_fuse_depth(benchmark::State& state) {
  const DepthViews& all = depth_views();
  SurfaceVolume volume(options_of(state));
  for (std::size_t n = 0; n < kViews; ++n) volume.fuse(all.views[n], all.T_c_w[n]);
  std::size_t n = 0;
  for (auto _ : state) {
    const std::size_t v = n++ % kViews;
    volume.fuse(make_depth_view(all.rig, all.depth[v], all.colour[v]), all.T_c_w[v]);
  }
}
BENCHMARK(prepare_and_fuse_depth)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond);

void mesh_of_volume(benchmark::State& state) {
  const DepthViews& all = depth_views();
  SurfaceVolume volume(options_of(state));
  for (std::size_t n = 0; n < kViews; ++n) volume.fuse(all.views[n], all.T_c_w[n]);
  for (auto _ : state) benchmark::DoNotOptimize(extract_mesh(volume));
}
BENCHMARK(mesh_of_volume)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond);

/// A keyframe's depth is fused, then the mesh of the blocks that it changed is made anew: the latter alone.
void mesh_of_changes(benchmark::State& state) {
  const DepthViews& all = depth_views();
  SurfaceVolume volume(options_of(state));
  for (std::size_t n = 0; n < kViews; ++n) volume.fuse(all.views[n], all.T_c_w[n]);
  MeshPieces pieces;
  pieces.update(volume);
  std::size_t n = 0, blocks = 0;
  for (auto _ : state) {
    state.PauseTiming();
    volume.fuse(all.views[n % kViews], all.T_c_w[n % kViews]);
    ++n;
    state.ResumeTiming();
    blocks += pieces.update(volume);
  }
  state.counters["blocks"] = static_cast<double>(blocks) / static_cast<double>(n);
}
BENCHMARK(mesh_of_changes)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond);

/// The same where the keyframe's submap is one of two that overlap: they are joined anew in these blocks, and
/// then meshed.
void compose(benchmark::State& state, const SE3& T_w_v) {
  const DepthViews& all = depth_views();
  std::array<SurfaceVolume, 2> volumes{SurfaceVolume(options_of(state)), SurfaceVolume(options_of(state))};
  for (std::size_t n = 0; n < kViews; ++n) volumes[n % 2].fuse(all.views[n], all.T_c_w[n]);
  const std::array<PlacedVolume, 2> placed{{{0, &volumes[0], T_w_v}, {1, &volumes[1], T_w_v}}};
  Composition composition(options_of(state));
  composition.update(placed);
  std::size_t n = 0, blocks = 0;
  for (auto _ : state) {
    state.PauseTiming();
    volumes[n % 2].fuse(all.views[n % kViews], all.T_c_w[n % kViews]);
    ++n;
    state.ResumeTiming();
    blocks += composition.update(placed);
  }
  state.counters["blocks"] = static_cast<double>(blocks) / static_cast<double>(n);
}
void compose_changes(benchmark::State& state) {
  compose(state, SE3(SO3::exp(Vector3(0.1, 0.2, 0.3)), Vector3(0.1, 0.2, 0.3)));
}
BENCHMARK(compose_changes)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond);

/// As submaps stand until a loop moves them: on the grid of the whole.
void compose_changes_on_grid(benchmark::State& state) {
  compose(state, SE3());
}
BENCHMARK(compose_changes_on_grid)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond);

/// A loop moves one of the two.
void compose_moved(benchmark::State& state) {
  const DepthViews& all = depth_views();
  std::array<SurfaceVolume, 2> volumes{SurfaceVolume(options_of(state)), SurfaceVolume(options_of(state))};
  for (std::size_t n = 0; n < kViews; ++n) volumes[n % 2].fuse(all.views[n], all.T_c_w[n]);
  Composition composition(options_of(state));
  double by = 0;
  for (auto _ : state) {
    by = by > 0 ? 0 : 0.02;
    composition.update(std::array<PlacedVolume, 2>{
        {{0, &volumes[0], SE3()}, {1, &volumes[1], SE3(SO3::exp(Vector3(by, by, by)), Vector3(by, 0, 0))}}});
  }
}
BENCHMARK(compose_moved)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond);

/// A loop moves all of eight submaps that overlap, by a degree and a few centimetres, each by its own.
void compose_loop(benchmark::State& state) {
  const DepthViews& all = depth_views();
  std::vector<SurfaceVolume> volumes;
  for (std::size_t v = 0; v < kViews; ++v) {
    volumes.emplace_back(options_of(state));
    for (std::size_t n = v; n < v + 4; ++n) volumes[v].fuse(all.views[n % kViews], all.T_c_w[n % kViews]);
  }
  Composition composition(options_of(state));
  std::size_t loops = 0, blocks = 0;
  for (auto _ : state) {
    ++loops;
    std::vector<PlacedVolume> placed;
    for (std::uint32_t v = 0; v < kViews; ++v) {
      const double by = 0.01 * std::sin(static_cast<double>(loops + 3 * v));
      placed.push_back({v, &volumes[v], SE3(SO3::exp(Vector3(by, -by, by)), Vector3(by, 2 * by, -by))});
    }
    blocks += composition.update(placed);
  }
  state.counters["blocks"] = static_cast<double>(blocks) / static_cast<double>(loops);
}
BENCHMARK(compose_loop)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond);

void pack_and_unpack_depth(benchmark::State& state) {
  const cv::Mat& depth = depth_views().depth.front();
  for (auto _ : state) benchmark::DoNotOptimize(PackedDepth(depth).unpacked());
}
BENCHMARK(pack_and_unpack_depth)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace twofold
