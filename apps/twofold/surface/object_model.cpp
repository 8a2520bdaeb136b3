#include "apps/twofold/surface/object_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "base/processor_time.hpp"
#include "surface/mesh_picture.hpp"
#include "surface/meshing.hpp"

namespace twofold {
namespace {

constexpr int kLeastPiece = 50;  // part of all triangles

/// Two directions across `up`.
std::array<Vector3, 2> across(const Vector3& up) {
  const Vector3 x = up.unitOrthogonal();
  return {x, up.cross(x)};
}

std::optional<TurntableAxis> axis_of(const Trajectory& poses, const Vector3& up) {
  std::vector<double> seconds;
  std::vector<SE3> T_w_c;
  for (const TimedPose& pose : poses) {
    seconds.push_back(static_cast<double>(pose.t_ns - poses.front().t_ns) * 1e-9);
    T_w_c.push_back(pose.T_w_c);
  }
  return fit_turntable_axis(seconds, T_w_c, up);
}

}  // namespace

ObjectBox box_around(const TriangleMesh& mesh, const Vector3& up) {
  constexpr int kDirections = 180;  // over a right angle
  const auto [x, y] = across(up);
  ObjectBox best;
  double least_area = 1e300;
  for (int d = 0; d < kDirections; ++d) {
    const double angle = 0.5 * std::numbers::pi * d / kDirections;
    const std::array<Vector3, 3> axes{std::cos(angle) * x + std::sin(angle) * y,
                                      std::cos(angle) * y - std::sin(angle) * x, up};
    Vector3 low = Vector3::Constant(1e300), high = -low;
    for (const Eigen::Vector3f& p : mesh.positions) {
      const Vector3 at(axes[0].dot(p.cast<double>()), axes[1].dot(p.cast<double>()),
                       axes[2].dot(p.cast<double>()));
      low = low.cwiseMin(at);
      high = high.cwiseMax(at);
    }
    const Vector3 size = high - low;
    if (size.x() * size.y() >= least_area) continue;
    least_area = size.x() * size.y();
    const Vector3 middle = 0.5 * (low + high);
    best = {middle.x() * axes[0] + middle.y() * axes[1] + middle.z() * axes[2], size, axes};
  }
  if (best.size.x() < best.size.y()) {
    std::swap(best.size.x(), best.size.y());
    best.axes = {best.axes[1], -best.axes[0], best.axes[2]};
  }
  return best;
}

double widest_view_angle(const Vector3& x_w, const Trajectory& poses) {
  std::vector<Vector3> directions;
  for (const TimedPose& pose : poses) {
    const Vector3 direction = (pose.T_w_c.translation() - x_w).normalized();
    constexpr double kSame = 0.01;  // [rad]: how finely it is told
    const auto is_near = [&](const Vector3& other) { return (other - direction).norm() < kSame; };
    if (std::none_of(directions.begin(), directions.end(), is_near)) directions.push_back(direction);
  }
  double least = 1;
  for (std::size_t a = 0; a < directions.size(); ++a)
    for (std::size_t b = 0; b < a; ++b) least = std::min(least, directions[a].dot(directions[b]));
  return std::acos(std::max(least, -1.0));
}

cv::Mat draw_object(const ObjectModel& model) {
  constexpr int kWidth = 600, kHeight = 800;  // of a view
  constexpr double kAbove = 0.5, kAside = 0.35;
  cv::Mat all(kHeight, 4 * kWidth, CV_8UC3, cv::Scalar(255, 255, 255));
  for (int view = 0; view < 4; ++view) {
    const double angle = 0.5 * std::numbers::pi * view + kAside;
    const Vector3 facing =
        std::cos(angle) * model.box.axes[0] + std::sin(angle) * model.box.axes[1] + kAbove * model.up;
    cv::Mat picture =
        draw_mesh(model.mesh, model.mesh.colours, view_from(model.mesh, facing, model.up, kWidth));
    if (picture.rows > kHeight)
      cv::resize(picture, picture, {picture.cols * kHeight / picture.rows, kHeight}, 0, 0, cv::INTER_AREA);
    const int left = view * kWidth + (kWidth - picture.cols) / 2, top = (kHeight - picture.rows) / 2;
    picture.copyTo(all(cv::Rect(left, top, picture.cols, picture.rows)));
  }
  return all;
}

ObjectModel build_object(const ObjectSource& source, const Trajectory& poses, const SurfaceOptions& options) {
  ObjectModel model;
  SurfaceVolume volume(options);
  Vector3 up = Vector3::Zero();
  std::int64_t fusion_ns = 0;
  auto pose = poses.begin();
  for (const ObjectSource::Kept& kept : source.kept()) {
    while (pose != poses.end() && pose->t_ns < kept.t_ns) ++pose;
    if (pose == poses.end()) break;
    if (pose->t_ns != kept.t_ns) continue;
    const std::int64_t begin_ns = thread_cpu_ns();
    volume.fuse(make_depth_view(source.rig(), kept.images.depth.unpacked(), kept.images.colour.unpacked()),
                pose->T_w_c.inverse());
    fusion_ns += thread_cpu_ns() - begin_ns;
    up += pose->T_w_c.so3() * kept.up_c;
    ++model.figures.fused;
  }
  if (model.figures.fused == 0) return model;
  model.up = up.normalized();
  const std::int64_t begin_ns = thread_cpu_ns();
  model.mesh = extract_mesh(volume);
  drop_small_pieces(model.mesh, static_cast<int>(model.mesh.triangles.size()) / kLeastPiece);
  drop_pieces_beside(model.mesh, model.up);
  SurfaceFigures& f = model.figures;
  f.mesh_ms = static_cast<double>(thread_cpu_ns() - begin_ns) * 1e-6;
  f.fusion_ms = static_cast<double>(fusion_ns) * 1e-6 / f.fused;
  describe_volume(volume, f);
  f.memory_mb = static_cast<double>(volume.bytes()) / (1 << 20);
  f.triangles = model.mesh.triangles.size();
  f.left_out = source.left_out();
  f.colour = source.colour();
  model.axis = axis_of(poses, model.up);
  if (!model.mesh.triangles.empty()) model.box = box_around(model.mesh, model.up);
  return model;
}

}  // namespace twofold
