// Open3D's fusion of the views that surface_bench fuses; only where its library is installed. It takes as
// many threads as the machine has, whatever omp_set_num_threads says, and one with OMP_NUM_THREADS=1
// open3d_bench.
#include <benchmark/benchmark.h>
#include <open3d/pipelines/integration/ScalableTSDFVolume.h>

#include "bench/surface/depth_views.hpp"
#include "bench/surface/open3d_images.hpp"

namespace twofold {
namespace {

/// Truncation as here: four voxels.
void fuse_depth_open3d(benchmark::State& state) {
  using namespace open3d::pipelines::integration;
  const DepthViews& all = depth_views();
  const auto intrinsic = open3d_camera(all.rig.camera);
  const double voxel = 1e-3 * static_cast<double>(state.range(0));
  ScalableTSDFVolume volume(voxel, 4 * voxel, TSDFVolumeColorType::RGB8);
  std::vector<std::shared_ptr<open3d::geometry::RGBDImage>> images;
  for (std::size_t n = 0; n < kViews; ++n) {
    images.push_back(open3d_rgbd(all.rig, all.depth[n], all.colour[n]));
    volume.Integrate(*images[n], intrinsic, all.T_c_w[n].matrix());
  }
  std::size_t n = 0;
  for (auto _ : state) {
    const std::size_t v = n++ % kViews;
    volume.Integrate(*images[v], intrinsic, all.T_c_w[v].matrix());
  }
}
BENCHMARK(fuse_depth_open3d)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

}  // namespace
}  // namespace twofold

BENCHMARK_MAIN();
