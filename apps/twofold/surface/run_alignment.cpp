#include "apps/twofold/surface/run_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/angles.hpp"
#include "base/check.hpp"
#include "geometry/absolute_orientation.hpp"

namespace twofold {
namespace {

constexpr double kContradiction = 10 * kDegree;  // root mean square; tracking errs by less
constexpr double kLeastWeight = 0.1;             // that positions have beside orientations

/// Of the six sides of cameras at T_x_c, two for each axis.
void add_sides(const SE3& T_x_c, double distance, std::vector<Vector3>& points) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-distance, distance})
      points.push_back(T_x_c * Vector3(side * Vector3::Unit(axis)));
  }
}

double rotation_rmse(const std::vector<PosePair>& pairs, const SE3& T_w_e) {
  double squares = 0;
  for (const PosePair& pair : pairs)
    squares += (pair.T_w_c.so3().inverse() * T_w_e.so3() * pair.T_e_c.so3()).log().squaredNorm();
  return std::sqrt(squares / static_cast<double>(pairs.size()));
}

/// What the centres add to the least squares for the rotation about the axis that they say least about, over
/// what the sides add: their mean square from that axis over two thirds of the squared distance.
double weight_of_positions(const std::vector<PosePair>& pairs, double distance) {
  const Vector3 spread = spread_of_positions(pairs);
  return (spread[0] + spread[1]) / (2.0 / 3.0 * distance * distance);
}

}  // namespace

double viewing_distance(const TriangleMesh& estimate, const std::vector<PosePair>& pairs) {
  TWOFOLD_CHECK(!estimate.positions.empty() && !pairs.empty(), "vertices and poses");
  constexpr std::size_t kMost = 1000;
  const std::size_t vertex_step = 1 + estimate.positions.size() / kMost;
  const std::size_t pose_step = 1 + pairs.size() / kMost;
  std::vector<double> distances;
  for (std::size_t v = 0; v < estimate.positions.size(); v += vertex_step) {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t p = 0; p < pairs.size(); p += pose_step)
      nearest =
          std::min(nearest, (estimate.positions[v].cast<double>() - pairs[p].T_e_c.translation()).norm());
    distances.push_back(nearest);
  }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

std::optional<RunAlignment> align_run(const std::vector<PosePair>& pairs, double distance) {
  TWOFOLD_CHECK(distance > 0, "distance above zero");
  std::vector<Vector3> x_w, x_e;
  for (const PosePair& pair : pairs) {
    add_sides(pair.T_w_c, distance, x_w);
    add_sides(pair.T_e_c, distance, x_e);
  }
  const auto T_w_e = align_rigid(x_w, x_e);
  if (!T_w_e) return std::nullopt;
  if (rotation_rmse(pairs, *T_w_e) <= kContradiction)
    return RunAlignment{*T_w_e, weight_of_positions(pairs, distance) >= kLeastWeight, false};
  const auto S_w_e = align(pairs, Alignment::kSe3);
  if (!S_w_e) return std::nullopt;
  return RunAlignment{SE3(S_w_e->so3(), S_w_e->translation()), true, true};
}

}  // namespace twofold
