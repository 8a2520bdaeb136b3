#include "bench/surface/fuser_comparison.hpp"

#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "io/files/mesh_file.hpp"
#include "io/plots/plot.hpp"
#include "io/sources/open_source.hpp"
#include "surface/mesh_picture.hpp"
#include "surface/meshing.hpp"
#include "surface/volume.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr int kPictureWidth = 1400;

/// The source's world in the frame of the grids.
SE3 T_v_w() {
  return {SO3::exp(Vector3(0.3, -0.5, 0.4)), Vector3(0.1013, -0.2027, 0.3031)};
}

/// Of all threads: a library may start some.
double process_cpu_ms() {
  timespec t{};
  (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

class TwofoldFuser final : public DepthFuser {
 public:
  explicit TwofoldFuser(const FuserSettings& settings) : rig_(settings.rig), volume_(options_of(settings)) {}

  void fuse(const PosedDepth& image) override {
    volume_.fuse(make_depth_view(rig_, image.depth, image.colour), image.T_c_v);
  }
  TriangleMesh mesh() override { return extract_mesh(volume_); }

 private:
  static SurfaceOptions options_of(const FuserSettings& settings) {
    SurfaceOptions options;
    options.voxel = settings.voxel;
    options.truncation = settings.truncation;
    options.depth_noise = usual_depth_noise(settings.rig);
    return options;
  }

  Rig rig_;
  SurfaceVolume volume_;
};

/// Means of the triangles' normals around each vertex, larger ones counting more.
void add_normals(TriangleMesh& mesh) {
  mesh.normals.assign(mesh.positions.size(), Eigen::Vector3f::Zero());
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3f a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    for (const std::uint32_t v : t) mesh.normals[v] += (b - a).cross(c - a);
  }
  for (Eigen::Vector3f& n : mesh.normals) n = n.norm() > 0 ? n.normalized() : Eigen::Vector3f::UnitZ();
}

struct Costs {
  double fusion_ms = 0;
  int images = 0;
};

struct Arguments {
  std::string source;
  fs::path folder;
  double voxel = 0.005, truncation = 4;
  std::int64_t every = 24;
};

SE3 true_pose(const FrameSource& source, std::int64_t t_ns) {
  const Trajectory& poses = source.ground_truth();
  const auto pose = std::lower_bound(poses.begin(), poses.end(), t_ns,
                                     [](const TimedPose& p, std::int64_t t) { return p.t_ns < t; });
  if (pose == poses.end() || pose->t_ns != t_ns) throw std::runtime_error("a frame has no true pose");
  return pose->T_w_c;
}

PosedDepth posed_depth(const FrameSource& source, const Frame& frame) {
  PosedDepth image{frame.depth, source.colour_image(frame.index),
                   (T_v_w() * true_pose(source, frame.t_ns)).inverse()};
  if (image.colour.empty()) cv::cvtColor(frame.left, image.colour, cv::COLOR_GRAY2BGR);
  return image;
}

void fuse_all(FrameSource& source, std::int64_t every, std::vector<NamedFuser>& fusers,
              std::vector<Costs>& costs) {
  Frame frame;
  FrameStatus status;
  for (std::int64_t n = 0; (status = source.next(frame)) == FrameStatus::kFrame; ++n) {
    if (n % every != 0) continue;
    const PosedDepth image = posed_depth(source, frame);
    for (std::size_t f = 0; f < fusers.size(); ++f) {
      fusers[f].fuser->prepare(image);
      const double begin_ms = process_cpu_ms();
      fusers[f].fuser->fuse(image);
      costs[f].fusion_ms += process_cpu_ms() - begin_ms;
      ++costs[f].images;
    }
  }
  if (status == FrameStatus::kError) throw std::runtime_error(source.error());
}

void move(const SE3& T, TriangleMesh& mesh) {
  for (Eigen::Vector3f& x : mesh.positions) x = (T * Vector3(x.cast<double>())).cast<float>();
  for (Eigen::Vector3f& n : mesh.normals) n = (T.rotation() * n.cast<double>()).cast<float>();
}

void write_result(const fs::path& folder, NamedFuser& named, const Costs& costs) {
  const double begin_ms = process_cpu_ms();
  TriangleMesh mesh = named.fuser->mesh();
  const double mesh_ms = process_cpu_ms() - begin_ms;
  std::printf("| %s | %d | %.1f | %.0f | %zu |\n", named.name.c_str(), costs.images,
              costs.fusion_ms / std::max(1, costs.images), mesh_ms, mesh.triangles.size());
  move(T_v_w().inverse(), mesh);
  write_ply_mesh(folder / (named.name + ".ply"), mesh);
  if (mesh.normals.empty()) add_normals(mesh);
  write_png(folder / (named.name + ".png"),
            draw_mesh(mesh, {}, overview_of(mesh, Vector3::UnitZ(), kPictureWidth)));
}

void compare(const Arguments& arguments, MakeFusers make_others) {
  const auto source = open_source(arguments.source);
  if (source->rig().kind != SensorKind::kRgbd) throw std::runtime_error("the source gives no depth images");
  const FuserSettings settings{source->rig(), arguments.voxel, arguments.truncation};
  std::vector<NamedFuser> fusers;
  fusers.push_back({"twofold", std::make_unique<TwofoldFuser>(settings)});
  for (NamedFuser& other : make_others(settings)) fusers.push_back(std::move(other));
  std::vector<Costs> costs(fusers.size());
  fuse_all(*source, arguments.every, fusers, costs);
  fs::create_directories(arguments.folder);
  std::printf(
      "| | depth images | fused, CPU-ms each | meshed, CPU-ms | triangles |\n|---|---|---|---|---|\n");
  for (std::size_t f = 0; f < fusers.size(); ++f) write_result(arguments.folder, fusers[f], costs[f]);
}

}  // namespace

cv::Mat without_jumps(const Rig& rig, const cv::Mat& depth) {
  cv::Mat left = depth.clone();
  left.setTo(0, make_depth_view(rig, depth, {}).depth == 0);
  return left;
}

int compare_fusers(int argc, char** argv, MakeFusers make_others) try {
  if (argc < 3) {
    std::fprintf(stderr, "%s SOURCE FOLDER [VOXEL [EVERY [TRUNCATION]]]\n", argv[0]);
    return 2;
  }
  Arguments arguments{argv[1], argv[2]};
  if (argc > 3) arguments.voxel = std::atof(argv[3]);
  if (argc > 4) arguments.every = std::atol(argv[4]);
  if (argc > 5) arguments.truncation = std::atof(argv[5]);
  if (!(arguments.voxel > 0) || arguments.every < 1 || !(arguments.truncation > 0)) {
    std::fprintf(stderr, "VOXEL [m], EVERY and TRUNCATION [voxels] are above 0\n");
    return 2;
  }
  compare(arguments, make_others);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}

}  // namespace twofold
