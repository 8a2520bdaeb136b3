// The usual way of fusing depth into OpenVDB's grids, on one core, of the views that surface_bench fuses;
// only where its library is installed.
#include <benchmark/benchmark.h>

#include "bench/surface/depth_views.hpp"
#include "bench/surface/vdb_volume.hpp"

namespace twofold {
namespace {

void fuse_depth_openvdb(benchmark::State& state) {
  openvdb::initialize();
  const DepthViews& all = depth_views();
  VdbVolume volume(1e-3 * static_cast<double>(state.range(0)), 4);
  for (std::size_t n = 0; n < kViews; ++n) volume.fuse(all.views[n], all.T_c_w[n]);
  std::size_t n = 0;
  for (auto _ : state) {
    const std::size_t v = n++ % kViews;
    volume.fuse(all.views[v], all.T_c_w[v]);
  }
}
BENCHMARK(fuse_depth_openvdb)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

}  // namespace
}  // namespace twofold
