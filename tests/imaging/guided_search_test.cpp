#include "imaging/guided_search.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "imaging/fast_corners.hpp"
#include "rendered_scene.hpp"

namespace twofold {
namespace {

using testing::RenderedScene;
using testing::test_rig;

constexpr double kNoise = 2;  // sensor noise [grey]

struct Start {
  PointAppearance appearance;
  Vector3 psi;
  Corner corner;
};

/// Corners of one view with their true depth.
std::vector<Start> corners_of(const RenderedScene& scene, const Rig& rig, const FrameImages& images, const SE3& T_c_w,
                              int levels) {
  std::vector<Corner> corners;
  corners.reserve(4000);
  CellGrid grid{32, rig.camera.width / 32, rig.camera.height / 32, {}};
  const std::vector<std::uint8_t> free_cells(static_cast<std::size_t>(grid.columns * grid.rows), 0);
  grid.occupied = free_cells;
  for (int level = 0; level < levels; ++level)
    detect_corners(images.left.level(level), level, 10, 15, 12, grid, corners);
  std::vector<Start> starts;
  for (const Corner& corner : corners) {
    Start start;
    start.corner = corner;
    if (!cut_appearance(images.left.level(corner.level), corner.u, corner.v, corner.level, start.appearance)) continue;
    const Vector2 uv = start.appearance.uv.cast<double>();
    const Vector3 ray = rig.camera.unproject(uv);
    start.psi = {ray.x(), ray.y(), 1 / scene.depth(T_c_w, uv)};
    starts.push_back(start);
  }
  return starts;
}

struct Errors {
  std::vector<double> u, v, r;  // in pixels of the level
  int tried = 0;
  int with_right = 0;
};

double rms(const std::vector<double>& e) {
  double sum = 0;
  for (double x : e) sum += x * x;
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, e.size())));
}
double mean(const std::vector<double>& e) {
  double sum = 0;
  for (double x : e) sum += x;
  return sum / static_cast<double>(std::max<std::size_t>(1, e.size()));
}
double median_abs(std::vector<double> e) {
  if (e.empty()) return 0;
  for (double& x : e) x = std::abs(x);
  std::nth_element(e.begin(), e.begin() + static_cast<std::ptrdiff_t>(e.size() / 2), e.end());
  return e[e.size() / 2];
}

void report(const char* name, const Errors& e) {
  std::printf("%-28s tried %d found %zu right %d | u rms %.3f med %.3f mean %+.3f | v rms %.3f med %.3f mean %+.3f | disparity rms %.3f med %.3f mean %+.3f\n", name, e.tried, e.u.size(),
              e.with_right, rms(e.u), median_abs(e.u), mean(e.u), rms(e.v), median_abs(e.v), mean(e.v), rms(e.r), median_abs(e.r), mean(e.r));
}

class GuidedSearch : public ::testing::Test {
 protected:
  Rig rig_ = test_rig(SensorKind::kStereo);
  RenderedScene scene_{rig_, {4, 2.5, 5}, 7};
  FrameImages first_, second_;
};

TEST_F(GuidedSearch, Explore) {
  const SE3 T_a_w;
  scene_.render(T_a_w, kNoise, first_);
  const std::vector<Start> starts = corners_of(scene_, rig_, first_, T_a_w, 3);
  struct Motion {
    const char* name;
    Vector6 xi;
  };
  std::vector<Motion> motions(6);
  motions[0] = {"none", Vector6::Zero()};
  motions[1] = {"sideways 0.1", (Vector6() << 0.1, 0.02, 0, 0, 0, 0).finished()};
  motions[2] = {"forward 0.5", (Vector6() << 0.01, 0.02, -0.5, 0, 0, 0).finished()};
  motions[3] = {"forward 1.2", (Vector6() << 0.01, 0.02, -1.2, 0, 0, 0).finished()};
  motions[4] = {"roll 20 deg", (Vector6() << 0.1, 0.02, 0, 0, 0, 0.35).finished()};
  motions[5] = {"yaw 15 deg", (Vector6() << 0.1, 0.02, 0, 0, 0.26, 0).finished()};
  for (const Motion& motion : motions) {
    const SE3 T_c_a = SE3::exp(motion.xi);
    scene_.render(T_c_a * T_a_w, kNoise, second_);
    for (int level = 0; level < 3; ++level) {
      Errors errors;
      for (const Start& start : starts) {
        if (start.corner.level != level) continue;
        const Vector3 x_a(start.psi.x() / start.psi.z(), start.psi.y() / start.psi.z(), 1 / start.psi.z());
        const Vector3 x_c = T_c_a * x_a;
        if (x_c.z() < 0.3) continue;
        const Vector3 truth = rig_.project(x_c);
        if (!rig_.camera.contains(truth.head<2>(), 20)) continue;
        ++errors.tried;
        const auto found = find_point(second_, rig_, start.appearance, start.psi, T_c_a, {});
        if (!found) continue;
        const double s = std::ldexp(1.0, -found->level);
        errors.u.push_back((found->z.x() - truth.x()) * s);
        errors.v.push_back((found->z.y() - truth.y()) * s);
        if (std::isnan(found->z.z())) continue;
        ++errors.with_right;
        errors.r.push_back(((found->z.x() - found->z.z()) - (truth.x() - truth.z())) * s);
      }
      report((std::string(motion.name) + " level " + std::to_string(level)).c_str(), errors);
    }
  }
  Errors errors;
  for (int level = 0; level < 3; ++level) {
    Errors row;
    for (const Start& start : starts) {
      if (start.corner.level != level) continue;
      ++row.tried;
      const double u_r = right_from_row(first_, rig_, start.corner.u, start.corner.v, level, {});
      if (std::isnan(u_r)) continue;
      ++row.with_right;
      const double disparity = rig_.disparity_from_depth(1 / start.psi.z());
      row.r.push_back((start.appearance.uv.x() - u_r - disparity) * std::ldexp(1.0, -level));
    }
    report("right_from_row", row);
  }
}

}  // namespace
}  // namespace twofold
