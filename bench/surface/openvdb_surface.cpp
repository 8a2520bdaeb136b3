// The surface that OpenVDB makes of the same depth images and poses, beside Twofold's (fuser_comparison.hpp):
// vdb_volume.hpp fuses, OpenVDB's own VolumeToMesh makes the mesh, of images with and without the readings
// beside jumps.
#include <openvdb/tools/VolumeToMesh.h>

#include <cmath>

#include "bench/surface/fuser_comparison.hpp"
#include "bench/surface/vdb_volume.hpp"

namespace twofold {
namespace {

/// A view with nothing but what VdbVolume reads.
DepthView plain_view(const Rig& rig, const PosedDepth& image) {
  DepthView view;
  view.camera = rig.camera;
  image.depth.convertTo(view.depth, CV_32F, rig.depth_unit);
  view.depth.setTo(0, view.depth > rig.depth_max);
  view.colour = image.colour;
  return view;
}

class OpenVdbFuser final : public DepthFuser {
 public:
  OpenVdbFuser(const FuserSettings& settings, bool jumps_left_out)
      : rig_(settings.rig),
        jumps_left_out_(jumps_left_out),
        voxel_(settings.voxel),
        volume_(settings.voxel, settings.truncation) {}

  void prepare(const PosedDepth& image) override {
    view_ = jumps_left_out_ ? make_depth_view(rig_, image.depth, image.colour) : plain_view(rig_, image);
  }
  void fuse(const PosedDepth& image) override { volume_.fuse(view_, image.T_c_v); }

  /// Its quadrilaterals, each as two triangles; those that rest on samples which were never seen are left
  /// out: it would close the field there.
  TriangleMesh mesh() override {
    openvdb::tools::VolumeToMesh mesher;
    mesher(volume_.distances());
    TriangleMesh mesh;
    std::vector<bool> known;
    for (std::size_t n = 0; n < mesher.pointListSize(); ++n) {
      const openvdb::Vec3s& x = mesher.pointList()[n];
      known.push_back(rests_on_seen(x));
      mesh.positions.emplace_back(Eigen::Vector3f(x.x(), x.y(), x.z()) * static_cast<float>(voxel_));
      mesh.colours.push_back(colour_at(x));
    }
    for (std::size_t p = 0; p < mesher.polygonPoolListSize(); ++p) {
      const openvdb::tools::PolygonPool& pool = mesher.polygonPoolList()[p];
      for (std::size_t n = 0; n < pool.numQuads(); ++n) {
        const openvdb::Vec4I& q = pool.quad(n);
        if (!known[q[0]] || !known[q[1]] || !known[q[2]] || !known[q[3]]) continue;
        mesh.triangles.push_back({q[0], q[1], q[2]});
        mesh.triangles.push_back({q[0], q[2], q[3]});
      }
    }
    return mesh;
  }

 private:
  /// x: in voxels, in the cell whose eight samples it was made of.
  [[nodiscard]] bool rests_on_seen(const openvdb::Vec3s& x) const {
    const auto weights = volume_.weights().getConstAccessor();
    const openvdb::Coord first = openvdb::Coord::floor(x);
    for (int n = 0; n < 8; ++n)
      if (weights.getValue(first.offsetBy(n & 1, n >> 1 & 1, n >> 2)) == 0) return false;
    return true;
  }
  [[nodiscard]] std::array<std::uint8_t, 3> colour_at(const openvdb::Vec3s& x) const {
    const openvdb::Vec3s rgb = volume_.colours().getConstAccessor().getValue(openvdb::Coord::round(x));
    return {static_cast<std::uint8_t>(std::lround(rgb.x())), static_cast<std::uint8_t>(std::lround(rgb.y())),
            static_cast<std::uint8_t>(std::lround(rgb.z()))};
  }

  Rig rig_;
  bool jumps_left_out_;
  double voxel_;
  VdbVolume volume_;
  DepthView view_;
};

std::vector<NamedFuser> openvdb_fusers(const FuserSettings& settings) {
  std::vector<NamedFuser> fusers;
  fusers.push_back({"openvdb", std::make_unique<OpenVdbFuser>(settings, false)});
  fusers.push_back({"openvdb_without_jumps", std::make_unique<OpenVdbFuser>(settings, true)});
  return fusers;
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  openvdb::initialize();
  return twofold::compare_fusers(argc, argv, twofold::openvdb_fusers);
}
