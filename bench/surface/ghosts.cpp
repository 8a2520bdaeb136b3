// What is left of a thing that stood for a while and was taken away:  ghosts FOLDER [VOXEL [EVERY]]
//
// A carton stands on the rendered `desk` while a depth camera looks along it, and is away when the camera
// looks along it again, and once more. Every EVERY-th (24) of its images along true poses is fused with
// VOXELs (0.005 m). Of the carton's surface in the mesh, where no true surface is within three voxels, the
// share that is still there is printed, by the number of images since that saw through its place by more than
// three voxels. Meshes go to FOLDER, as PLY and as pictures: with the carton, and at the end.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <vector>

#include "io/files/mesh_file.hpp"
#include "io/plots/plot.hpp"
#include "surface/mesh_picture.hpp"
#include "surface/meshing.hpp"
#include "surface/triangle_grid.hpp"
#include "surface/volume.hpp"
#include "synthetic/furniture.hpp"
#include "synthetic/image_effects.hpp"
#include "synthetic/renderer.hpp"
#include "synthetic/scene_mesh.hpp"
#include "synthetic/scenes.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr double kFps = 30;
constexpr double kNear = 0.01;      // [m]: so far from its place a surface is the carton's
constexpr float kSpacing = 0.003F;  // [m] of the points that are looked at
constexpr int kPictureWidth = 1400;

struct Arguments {
  fs::path folder;
  double voxel = 0.005;
  int every = 24;
};

/// A carton on the desk.
class Carton {
 public:
  explicit Carton(synthetic::Staging& staging) : size_(staging.object_size) {
    const double height = 0.75 + 0.5 * size_.z();
    quads_ =
        synthetic::box_quads(synthetic::standing(0.15, -0.3, height, 0.4), size_, staging.object_texture);
    T_o_w_ = synthetic::standing(0.15, -0.3, height, 0.4).inverse();
  }
  [[nodiscard]] const std::vector<synthetic::Quad>& quads() const { return quads_; }
  /// [m]
  [[nodiscard]] double distance(const Vector3& x_w) const {
    const Vector3 beyond = (T_o_w_ * x_w).cwiseAbs() - 0.5 * size_;
    const double outside = beyond.cwiseMax(0).norm();
    return std::abs(outside > 0 ? outside : beyond.maxCoeff());
  }

 private:
  Vector3 size_;
  std::vector<synthetic::Quad> quads_;
  SE3 T_o_w_;
};

/// Points of a mesh that are the carton's alone.
std::vector<Eigen::Vector3f> points_of(const Carton& carton, const TriangleMesh& mesh,
                                       const TriangleMesh& truth, double voxel) {
  const auto apart = static_cast<float>(3 * voxel);
  const TriangleGrid scene(truth, apart);
  std::vector<Eigen::Vector3f> points;
  for (const MeshPoint& point : sample_surface(mesh, kSpacing)) {
    if (carton.distance(point.position.cast<double>()) > kNear) continue;
    if (scene.distance(point.position) >= apart) points.push_back(point.position);
  }
  return points;
}

/// A depth camera's walk along the desk.
class DeskWalk {
 public:
  DeskWalk() : staging_(synthetic::make_desk(1)), carton_(staging_) {
    rig_.kind = SensorKind::kRgbd;
    rig_.camera = {420, 420, 319.5, 239.5, 640, 480};
    rig_.baseline = 0.11;
    rig_.depth_max = 8;
  }
  [[nodiscard]] const Rig& rig() const { return rig_; }
  [[nodiscard]] const Carton& carton() const { return carton_; }
  [[nodiscard]] int frames_a_round() const { return static_cast<int>(staging_.round_seconds * kFps); }
  [[nodiscard]] TriangleMesh truth() const { return synthetic::mesh_of(staging_.scene); }
  [[nodiscard]] SE3 T_c_w(int frame) const { return staging_.path(frame / kFps).inverse(); }
  [[nodiscard]] cv::Mat depth(int frame, bool with_carton) const {
    const synthetic::View view = synthetic::Renderer(staging_.scene)
                                     .render(rig_.camera, T_c_w(frame).inverse(),
                                             with_carton ? carton_.quads() : std::vector<synthetic::Quad>());
    return synthetic::sense_depth(view.inverse_depth, rig_, 1, {1, static_cast<std::uint64_t>(frame)});
  }

 private:
  synthetic::Staging staging_;
  Carton carton_;
  Rig rig_;
};

/// Whether an image looks through a place that is x_c in its camera's frame.
bool looks_through(const Rig& rig, const cv::Mat& depth, const Vector3& x_c, double voxel) {
  const auto uv = rig.camera.find_in_view(x_c);
  if (!uv) return false;
  const auto reading =
      depth.at<std::uint16_t>(static_cast<int>(uv->y() + 0.5), static_cast<int>(uv->x() + 0.5));
  return reading * rig.depth_unit > x_c.z() + 3 * voxel;
}

/// Which of the carton's points are still in the mesh, by how many images have seen through their places.
class Remains {
 public:
  Remains(std::vector<Eigen::Vector3f> points, double voxel)
      : points_(std::move(points)), looks_(points_.size(), 0), voxel_(voxel) {}

  /// After an image: it sees through some of the places, and the mesh is what it left.
  void look(const Rig& rig, const cv::Mat& depth, const SE3& T_c_w, const TriangleMesh& mesh) {
    const auto left = static_cast<float>(2 * voxel_);
    const TriangleGrid grid(mesh, left);
    for (std::size_t n = 0; n < points_.size(); ++n) {
      if (!looks_through(rig, depth, T_c_w * Vector3(points_[n].cast<double>()), voxel_)) continue;
      const std::size_t looks = std::min(++looks_[n], kMost);
      ++all_[looks];
      left_[looks] += grid.distance(points_[n]) < left ? 1 : 0;
    }
  }
  void print() const {
    std::printf("| images that saw through its place | points | left |\n|---|---|---|\n");
    for (std::size_t k = 1; k <= kMost; ++k) {
      if (all_[k] > 0)
        std::printf("| %zu%s | %d | %.1f %% |\n", k, k == kMost ? " and more" : "", all_[k],
                    100.0 * left_[k] / all_[k]);
    }
  }

 private:
  static constexpr std::size_t kMost = 16;
  std::vector<Eigen::Vector3f> points_;
  std::vector<std::size_t> looks_;
  double voxel_;
  std::array<int, kMost + 1> all_{}, left_{};
};

void write_mesh(const fs::path& file, const TriangleMesh& mesh) {
  write_ply_mesh(file.string() + ".ply", mesh);
  write_png(file.string() + ".png", draw_mesh(mesh, {}, overview_of(mesh, Vector3::UnitZ(), kPictureWidth)));
}

void measure(const Arguments& arguments) {
  const DeskWalk walk;
  SurfaceOptions options;
  options.voxel = arguments.voxel;
  options.depth_noise = usual_depth_noise(walk.rig());
  SurfaceVolume volume(options);
  const int round = walk.frames_a_round();
  const auto fuse = [&](int frame, bool with_carton) {
    const cv::Mat depth = walk.depth(frame, with_carton);
    volume.fuse(make_depth_view(walk.rig(), depth, {}), walk.T_c_w(frame));
    return depth;
  };
  int frame = 0;
  for (; frame < round; frame += arguments.every) (void)fuse(frame, true);
  const TriangleMesh with_carton = extract_mesh(volume);
  Remains remains(points_of(walk.carton(), with_carton, walk.truth(), arguments.voxel), arguments.voxel);
  TriangleMesh mesh;
  for (; frame < 3 * round; frame += arguments.every) {
    const cv::Mat depth = fuse(frame, false);
    mesh = extract_mesh(volume);
    remains.look(walk.rig(), depth, walk.T_c_w(frame), mesh);
  }
  remains.print();
  fs::create_directories(arguments.folder);
  write_mesh(arguments.folder / "with_carton", with_carton);
  write_mesh(arguments.folder / "at_the_end", mesh);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) try {
  if (argc < 2) {
    std::fprintf(stderr, "ghosts FOLDER [VOXEL [EVERY]]\n");
    return 2;
  }
  twofold::Arguments arguments{argv[1]};
  if (argc > 2) arguments.voxel = std::atof(argv[2]);
  if (argc > 3) arguments.every = std::atoi(argv[3]);
  if (!(arguments.voxel > 0) || arguments.every < 1) {
    std::fprintf(stderr, "VOXEL is above 0 [m], EVERY a number of frames\n");
    return 2;
  }
  twofold::measure(arguments);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
