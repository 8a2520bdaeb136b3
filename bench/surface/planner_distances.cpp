// How right a planner's distances are:  planner_distances SOURCE SEEN.ply [VOXEL [EVERY]]
//
// A SurfaceModel of every EVERY-th (18) frame along true poses, asked VOXEL (0.02 m) and some more before the
// surface, along its normals, with SurfaceModel::at and by SurfaceModel::distances in cells of two voxels.
// The truth is the distance to SEEN.ply (`twofold render SOURCE --seen`), whichever way it lies.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <numeric>
#include <string>
#include <vector>

#include "base/processor_time.hpp"
#include "io/files/mesh_file.hpp"
#include "surface/triangle_grid.hpp"
#include "twofold/source.hpp"
#include "twofold/surface.hpp"

namespace twofold {
namespace {

constexpr float kSpacing = 0.06F;     // [m] of the surface's points that are asked before
constexpr double kMaxDistance = 0.6;  // [m]

SurfaceModel model_of(const std::string& name, double voxel, int every) {
  Source source(name);
  SurfaceModel model(source.rig(), {.voxel_size = voxel});
  std::size_t n = 0;
  for (FrameView frame; source.next(frame); ++n) {
    if (n % static_cast<std::size_t>(every) == 0)
      model.add(frame, source.ground_truth().at(n).T_world_camera);
  }
  return model;
}

/// Of what one of both says, over the truth.
class Errors {
 public:
  void add(const SpacePoint& said, double truth, double voxel, const Eigen::Vector3d& away) {
    errors_.push_back(std::abs(said.distance - truth));
    too_large_ += said.distance > truth + voxel / 2 ? 1 : 0;
    const Eigen::Vector3d gradient(said.gradient[0], said.gradient[1], said.gradient[2]);
    turned_right_ += gradient.normalized().dot(away) > std::cos(20 * M_PI / 180) ? 1 : 0;
  }
  void print() {
    const auto count = static_cast<double>(errors_.size());
    std::sort(errors_.begin(), errors_.end());
    const auto at = [&](double share) { return errors_[static_cast<std::size_t>(share * (count - 1))]; };
    std::printf(" %6.1f / %6.1f mm, %4.1f %%, %4.1f %% |", 1e3 * at(0.5), 1e3 * at(0.95),
                100 * too_large_ / count, 100 * turned_right_ / count);
  }

 private:
  std::vector<double> errors_;
  double too_large_ = 0, turned_right_ = 0;
};

DistanceField field_before(const SurfaceModel& model, const TriangleMesh& seen, double voxel) {
  DistanceBox box{.resolution = 2 * voxel, .max_distance = kMaxDistance, .unknown_is_obstacle = false};
  for (int axis = 0; axis < 3; ++axis) {
    const auto [least, most] =
        std::minmax_element(seen.positions.begin(), seen.positions.end(),
                            [&](const auto& a, const auto& b) { return a[axis] < b[axis]; });
    box.min_corner[static_cast<std::size_t>(axis)] = (*least)[axis] - 0.1;
    box.max_corner[static_cast<std::size_t>(axis)] = (*most)[axis] + 0.1;
  }
  const std::int64_t begin_ns = thread_cpu_ns();
  DistanceField field = model.distances(box);
  std::printf("%zu cells of %.3f m in %.2f CPU-s\n", field.distances.size(), field.resolution,
              1e-9 * static_cast<double>(thread_cpu_ns() - begin_ns));
  return field;
}

void compare(const SurfaceModel& model, const TriangleMesh& seen, double voxel) {
  const TriangleGrid truth(seen, static_cast<float>(kMaxDistance));
  const DistanceField field = field_before(model, seen, voxel);
  std::printf(
      "| before the surface | points | at: median / p95 off, too large by half a voxel, gradient within 20 "
      "degrees | distances: likewise |\n|---|---|---|---|\n");
  for (const double before : {0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0}) {
    Errors at, nearest;
    std::size_t points = 0;
    bool has_at = true;
    for (const MeshPoint& point : sample_surface(seen, kSpacing)) {
      const auto& t = seen.triangles[point.triangle];
      const Eigen::Vector3f a = seen.positions[t[0]], b = seen.positions[t[1]], c = seen.positions[t[2]];
      const Eigen::Vector3f normal = (b - a).cross(c - a).normalized();
      const Eigen::Vector3f x = point.position + static_cast<float>(before * voxel) * normal;
      const std::array<double, 3> p{x.x(), x.y(), x.z()};
      const SpacePoint said = model.at(p);
      if (said.state != SpaceState::kFree) continue;
      const double distance = truth.distance(x);
      if (distance >= kMaxDistance) continue;
      constexpr float kStep = 1e-3F;  // [m]
      Eigen::Vector3d away;
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3f step = kStep * Eigen::Vector3f::Unit(axis);
        away[axis] = truth.distance(x + step) - truth.distance(x - step);
      }
      away.normalize();
      ++points;
      has_at &= before < 4;
      if (has_at) at.add(said, distance, voxel, away);
      nearest.add(field.at(p), distance, voxel, away);
    }
    if (points == 0) continue;
    std::printf("| %.0f mm | %zu |", 1e3 * before * voxel, points);
    if (has_at) {
      at.print();
    } else {
      std::printf(" only that it is free |");
    }
    nearest.print();
    std::printf("\n");
  }
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) try {
  if (argc < 3) {
    std::fprintf(stderr, "planner_distances SOURCE SEEN.ply [VOXEL [EVERY]]\n");
    return 2;
  }
  const double voxel = argc > 3 ? std::atof(argv[3]) : 0.02;
  const int every = argc > 4 ? std::atoi(argv[4]) : 18;
  if (!(voxel > 0) || every < 1) {
    std::fprintf(stderr, "VOXEL is above 0 [m], EVERY a number of frames\n");
    return 2;
  }
  twofold::compare(twofold::model_of(argv[1], voxel, every), twofold::read_ply_mesh(argv[2]), voxel);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
