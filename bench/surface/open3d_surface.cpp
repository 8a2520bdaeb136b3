// The surface that Open3D makes of the same depth images and poses, beside Twofold's (fuser_comparison.hpp):
// its ScalableTSDFVolume, as it comes and of images without the readings beside jumps.
#include <omp.h>
#include <open3d/pipelines/integration/ScalableTSDFVolume.h>

#include <cmath>

#include "bench/surface/fuser_comparison.hpp"
#include "bench/surface/open3d_images.hpp"

namespace twofold {
namespace {

using open3d::pipelines::integration::ScalableTSDFVolume;
using open3d::pipelines::integration::TSDFVolumeColorType;

TriangleMesh to_mesh(const open3d::geometry::TriangleMesh& from) {
  TriangleMesh mesh;
  for (const Eigen::Vector3d& x : from.vertices_) mesh.positions.emplace_back(x.cast<float>());
  for (const Eigen::Vector3d& n : from.vertex_normals_) mesh.normals.emplace_back(n.cast<float>());
  for (const Eigen::Vector3d& c : from.vertex_colors_)
    mesh.colours.push_back({static_cast<std::uint8_t>(std::lround(255 * c.x())),
                            static_cast<std::uint8_t>(std::lround(255 * c.y())),
                            static_cast<std::uint8_t>(std::lround(255 * c.z()))});
  for (const Eigen::Vector3i& t : from.triangles_)
    mesh.triangles.push_back({static_cast<std::uint32_t>(t.x()), static_cast<std::uint32_t>(t.y()),
                              static_cast<std::uint32_t>(t.z())});
  return mesh;
}

class Open3dFuser final : public DepthFuser {
 public:
  Open3dFuser(const FuserSettings& settings, bool jumps_left_out)
      : rig_(settings.rig),
        jumps_left_out_(jumps_left_out),
        volume_(settings.voxel, settings.truncation * settings.voxel, TSDFVolumeColorType::RGB8) {}

  void prepare(const PosedDepth& image) override {
    const cv::Mat depth = jumps_left_out_ ? without_jumps(rig_, image.depth) : image.depth;
    image_ = open3d_rgbd(rig_, depth, image.colour);
  }
  void fuse(const PosedDepth& image) override {
    volume_.Integrate(*image_, open3d_camera(rig_.camera), image.T_c_v.matrix());
  }
  TriangleMesh mesh() override {
    const auto mesh = volume_.ExtractTriangleMesh();
    mesh->ComputeVertexNormals();
    return to_mesh(*mesh);
  }

 private:
  Rig rig_;
  bool jumps_left_out_;
  ScalableTSDFVolume volume_;
  std::shared_ptr<open3d::geometry::RGBDImage> image_;
};

std::vector<NamedFuser> open3d_fusers(const FuserSettings& settings) {
  std::vector<NamedFuser> fusers;
  fusers.push_back({"open3d", std::make_unique<Open3dFuser>(settings, false)});
  fusers.push_back({"open3d_without_jumps", std::make_unique<Open3dFuser>(settings, true)});
  return fusers;
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  omp_set_num_threads(1);  // the library has read OMP_NUM_THREADS when main begins
  return twofold::compare_fusers(argc, argv, twofold::open3d_fusers);
}
