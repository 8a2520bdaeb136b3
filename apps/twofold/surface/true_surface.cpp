#include "apps/twofold/surface/true_surface.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/files/mesh_file.hpp"
#include "surface/triangle_grid.hpp"

namespace twofold {
namespace {

constexpr float kPiece = 0.01f;  // longest side of a triangle that is seen or not [m]
constexpr int kEvery = 5;        // frames

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

/// Marks the pieces of a mesh that frames show.
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

  void look(const cv::Mat& depth, double unit, const SE3& T_c_w) {
    const Vector3 eye = T_c_w.inverse().translation();
    for (std::size_t n = 0; n < seen_.size(); ++n) {
      if (seen_[n] != 0 || normals_[n].dot(eye - centres_[n]) <= 0) continue;
      const Vector3 x_c = T_c_w * centres_[n];
      const auto uv = camera_.find_in_view(x_c);
      if (!uv) continue;
      const double read =
          unit * depth.at<std::uint16_t>(static_cast<int>(uv->y() + 0.5), static_cast<int>(uv->x() + 0.5));
      seen_[n] = read > 0 && std::abs(read - x_c.z()) < reading_within(x_c.z());
    }
  }
  [[nodiscard]] const std::vector<char>& seen() const { return seen_; }

 private:
  PinholeCamera camera_;
  std::vector<Vector3> centres_;
  std::vector<Vector3> normals_;  // of any length: a piece is seen from its outer side only
  std::vector<char> seen_;
};

}  // namespace

void write_true_surface(const std::filesystem::path& file, const FrameSource& source) {
  const TriangleMesh mesh = expect_surface(source);
  write_ply_mesh(file, mesh);
  fmt::print("{} triangles written to {}\n", mesh.triangles.size(), file.string());
}

void write_seen_surface(const std::filesystem::path& file, FrameSource& source) {
  if (source.rig().kind != SensorKind::kRgbd)
    throw IoError("--seen", "needs depth images: add sensor=rgbd to the source's keys");
  TriangleMesh mesh = subdivided(expect_surface(source), kPiece);
  SeenPieces pieces(mesh, source.rig().camera);
  const Trajectory& poses = source.ground_truth();
  Frame frame;
  FrameStatus status;
  for (std::int64_t n = 0; (status = source.next(frame)) == FrameStatus::kFrame; ++n) {
    if (n % kEvery != 0) continue;
    const auto pose = std::lower_bound(poses.begin(), poses.end(), frame.t_ns,
                                       [](const TimedPose& p, std::int64_t t) { return p.t_ns < t; });
    if (pose != poses.end() && pose->t_ns == frame.t_ns)
      pieces.look(frame.depth, source.rig().depth_unit, pose->T_w_c.inverse());
  }
  if (status == FrameStatus::kError) throw IoError("", source.error());
  std::size_t kept = 0;
  for (std::size_t n = 0; n < mesh.triangles.size(); ++n)
    if (pieces.seen()[n] != 0) mesh.triangles[kept++] = mesh.triangles[n];
  mesh.triangles.resize(kept);
  write_ply_mesh(file, mesh);
  fmt::print("{} triangles that were seen written to {}\n", kept, file.string());
}

}  // namespace twofold
