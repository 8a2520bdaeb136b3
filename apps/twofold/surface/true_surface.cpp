#include "apps/twofold/surface/true_surface.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/files/mesh_file.hpp"
#include "surface/mesh_picture.hpp"
#include "surface/triangle_grid.hpp"

namespace twofold {
namespace {

constexpr float kPiece = 0.01f;  // longest side of a triangle that is seen or not [m]
constexpr float kScreen = 0.1f;  // the same of what stands in the way of a pair [m]

TriangleMesh expect_surface(const FrameSource& source) {
  auto mesh = source.true_surface();
  if (!mesh) throw IoError("--surface", "only a rendered source knows its true surface");
  return *std::move(mesh);
}

/// How far a reading may be from the depth z of what it shows [m]: four times a structured-light camera's
/// noise.
double reading_within(double z) {
  return 0.003 + 0.006 * z * z;
}

/// What a camera sees of the scene.
struct Look {
  cv::Mat depth;  ///< CV_32FC1 [m]; 0: none
  SE3 T_c_w;
};

/// Marks the pieces of a mesh that cameras show.
class SeenPieces {
 public:
  SeenPieces(const TriangleMesh& mesh, const PinholeCamera& camera)
      : camera_(camera), seen_(mesh.triangles.size(), 0) {
    for (const auto& t : mesh.triangles) {
      const Vector3 a = mesh.positions[t[0]].cast<double>(), b = mesh.positions[t[1]].cast<double>(),
                    c = mesh.positions[t[2]].cast<double>();
      centres_.emplace_back((a + b + c) / 3);
      normals_.emplace_back((b - a).cross(c - a));
    }
  }

  /// Seen is what all of these cameras show.
  void look(const std::vector<Look>& cameras) {
    std::vector<Vector3> eyes;
    for (const Look& look : cameras) eyes.push_back(look.T_c_w.inverse().translation());
    for (std::size_t n = 0; n < seen_.size(); ++n) {
      if (seen_[n] != 0) continue;
      bool all = true;
      for (std::size_t c = 0; c < cameras.size() && all; ++c) all = shows(cameras[c], eyes[c], n);
      seen_[n] = all;
    }
  }
  [[nodiscard]] const std::vector<char>& seen() const { return seen_; }

 private:
  [[nodiscard]] bool shows(const Look& look, const Vector3& eye, std::size_t n) const {
    if (normals_[n].dot(eye - centres_[n]) <= 0) return false;
    const Vector3 x_c = look.T_c_w * centres_[n];
    const auto uv = camera_.find_in_view(x_c);
    if (!uv) return false;
    const double read =
        look.depth.at<float>(static_cast<int>(uv->y() + 0.5), static_cast<int>(uv->x() + 0.5));
    return read > 0 && std::abs(read - x_c.z()) < reading_within(x_c.z());
  }

  PinholeCamera camera_;
  std::vector<Vector3> centres_;
  std::vector<Vector3> normals_;  // of any length: a piece is seen from its outer side only
  std::vector<char> seen_;
};

/// The depth image, or, of a pair, what either camera has before it: depth comes from what both see.
std::vector<Look> looks_of(const Rig& rig, const Frame& frame, const SE3& T_c_w,
                           const TriangleMesh& screens) {
  if (rig.kind == SensorKind::kRgbd) {
    Look look{{}, T_c_w};
    frame.depth.convertTo(look.depth, CV_32F, rig.depth_unit);
    return {look};
  }
  const SE3 T_r_c(SO3(), Vector3(-rig.baseline, 0, 0));
  std::vector<Look> looks;
  for (const SE3& T : {T_c_w, T_r_c * T_c_w}) looks.push_back({depth_of_mesh(screens, {rig.camera, T}), T});
  return looks;
}

}  // namespace

void write_true_surface(const std::filesystem::path& file, const FrameSource& source) {
  const TriangleMesh mesh = expect_surface(source);
  write_ply_mesh(file, mesh);
  fmt::print("{} triangles written to {}\n", mesh.triangles.size(), file.string());
}

void write_seen_surface(const std::filesystem::path& file, FrameSource& source, int every) {
  const Rig& rig = source.rig();
  if (rig.kind == SensorKind::kMono)
    throw IoError("--seen", "one camera sees no depth: the source's sensor must be rgbd or stereo");
  const TriangleMesh truth = expect_surface(source), screens = subdivided(truth, kScreen);
  TriangleMesh mesh = subdivided(truth, kPiece);
  SeenPieces pieces(mesh, rig.camera);
  const Trajectory& poses = source.ground_truth();
  Frame frame;
  FrameStatus status;
  for (std::int64_t n = 0; (status = source.next(frame)) == FrameStatus::kFrame; ++n) {
    if (n % every != 0) continue;
    const auto pose = std::lower_bound(poses.begin(), poses.end(), frame.t_ns,
                                       [](const TimedPose& p, std::int64_t t) { return p.t_ns < t; });
    if (pose != poses.end() && pose->t_ns == frame.t_ns)
      pieces.look(looks_of(rig, frame, pose->T_w_c.inverse(), screens));
  }
  if (status == FrameStatus::kError) throw IoError(source.error());
  std::size_t kept = 0;
  for (std::size_t n = 0; n < mesh.triangles.size(); ++n)
    if (pieces.seen()[n] != 0) mesh.triangles[kept++] = mesh.triangles[n];
  mesh.triangles.resize(kept);
  write_ply_mesh(file, mesh);
  fmt::print("{} triangles that were seen written to {}\n", kept, file.string());
}

}  // namespace twofold
