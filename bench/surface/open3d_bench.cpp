// Open3D's fusion on one core, of the views that surface_bench fuses; only where its library is installed.
#include <benchmark/benchmark.h>
#include <open3d/geometry/RGBDImage.h>
#include <open3d/pipelines/integration/ScalableTSDFVolume.h>

#include <cstdlib>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "bench/surface/depth_views.hpp"

namespace twofold {
namespace {

constexpr double kFarthest = 8;  // [m]

open3d::geometry::Image image_of(const cv::Mat& pixels) {
  open3d::geometry::Image image;
  image.Prepare(pixels.cols, pixels.rows, pixels.channels(), static_cast<int>(pixels.elemSize1()));
  std::memcpy(image.data_.data(), pixels.data, pixels.total() * pixels.elemSize());
  return image;
}

/// Truncation as here: four voxels.
void fuse_depth_open3d(benchmark::State& state) {
  using namespace open3d::pipelines::integration;
  const DepthViews& all = depth_views();
  const PinholeCamera& c = all.rig.camera;
  const open3d::camera::PinholeCameraIntrinsic intrinsic(c.width, c.height, c.fx, c.fy, c.cx, c.cy);
  const double voxel = 1e-3 * static_cast<double>(state.range(0));
  ScalableTSDFVolume volume(voxel, 4 * voxel, TSDFVolumeColorType::RGB8);
  std::vector<std::shared_ptr<open3d::geometry::RGBDImage>> images;
  for (std::size_t n = 0; n < kViews; ++n) {
    cv::Mat rgb;
    cv::cvtColor(all.colour[n], rgb, cv::COLOR_BGR2RGB);
    images.push_back(open3d::geometry::RGBDImage::CreateFromColorAndDepth(
        image_of(rgb), image_of(all.depth[n]), 1 / all.rig.depth_unit, kFarthest, false));
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

int main(int argc, char** argv) {
  setenv("OMP_NUM_THREADS", "1", 1);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
