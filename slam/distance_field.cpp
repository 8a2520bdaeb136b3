#include "slam/distance_field.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "base/option_check.hpp"
#include "surface/free_space/nearest_points.hpp"
#include "surface/meshing.hpp"
#include "surface/triangle_grid.hpp"

namespace twofold {
namespace {

constexpr double kMostCells = 1 << 26;
constexpr double kFarthestCorner = 1e5;  // [m]

Eigen::Vector3d vector_of(const std::array<double, 3>& x) {
  return {x[0], x[1], x[2]};
}

/// Cells of a box, and of what is within reach of it.
struct Grid {
  explicit Grid(const DistanceBox& box)
      : size(((vector_of(box.max_corner) - vector_of(box.min_corner)) / box.resolution)
                 .array()
                 .ceil()
                 .cast<int>()),
        border(static_cast<int>(std::ceil(box.max_distance / box.resolution)) + 1),
        origin(vector_of(box.min_corner).array() - border * box.resolution) {}

  [[nodiscard]] Eigen::Vector3i whole() const { return size.array() + 2 * border; }
  /// Of a cell of the whole grid, as for_each_cell counts.
  [[nodiscard]] std::size_t number(const Eigen::Vector3i& at) const {
    const auto width = static_cast<std::size_t>(whole().x()), height = static_cast<std::size_t>(whole().y());
    return static_cast<std::size_t>(at.x()) +
           width * (static_cast<std::size_t>(at.y()) + height * static_cast<std::size_t>(at.z()));
  }
  /// Of a cell of the whole grid [m].
  [[nodiscard]] std::array<double, 3> middle(const Eigen::Vector3i& at, double resolution) const {
    const Eigen::Vector3d x = origin + resolution * (at.cast<double>().array() + 0.5).matrix();
    return {x.x(), x.y(), x.z()};
  }

  Eigen::Vector3i size;    ///< of the box
  int border;              ///< cells around it
  Eigen::Vector3d origin;  ///< lowest corner of the whole grid [m]
};

template <class Visit>
void for_each_cell(const Eigen::Vector3i& size, Visit&& visit) {
  Eigen::Vector3i at;
  for (at.z() = 0; at.z() < size.z(); ++at.z())
    for (at.y() = 0; at.y() < size.y(); ++at.y())
      for (at.x() = 0; at.x() < size.x(); ++at.x()) visit(at);
}

/// What is known of the middle of each cell of the whole grid.
std::vector<SpaceState> states_of(const SurfaceVolume& volume, const FreeSpace& free, const Grid& grid,
                                  double resolution) {
  std::vector<SpaceState> states;
  states.reserve(static_cast<std::size_t>(grid.whole().cast<std::int64_t>().prod()));
  for_each_cell(grid.whole(), [&](const Eigen::Vector3i& at) {
    states.push_back(space_point(volume, free, grid.middle(at, resolution)).state);
  });
  return states;
}

/// Where space that is known to be free ends without a surface: the middles of faces between free and unknown
/// cells [cells of the whole grid].
void add_frontier(const std::vector<SpaceState>& states, const Eigen::Vector3i& whole,
                  std::vector<Eigen::Vector3f>& points) {
  const std::array<std::size_t, 3> steps{
      1, static_cast<std::size_t>(whole.x()),
      static_cast<std::size_t>(whole.x()) * static_cast<std::size_t>(whole.y())};
  std::size_t number = 0;
  for_each_cell(whole, [&](const Eigen::Vector3i& at) {
    const SpaceState here = states[number];
    for (int axis = 0; axis < 3 && here != SpaceState::kOccupied; ++axis) {
      if (at[axis] + 1 == whole[axis]) continue;
      const SpaceState beside = states[number + steps[static_cast<std::size_t>(axis)]];
      if (beside == SpaceState::kOccupied || beside == here) continue;
      points.emplace_back(at.cast<float>().array() + 0.5F);
      points.back()[axis] += 0.5F;
    }
    ++number;
  });
}

/// Of the surface, so close that no cell that it passes through is without [cells of the whole grid].
std::vector<Eigen::Vector3f> surface_points(const SurfaceVolume& volume, const Grid& grid,
                                            double resolution) {
  TriangleMesh mesh = extract_mesh(volume);
  const Eigen::Vector3f origin = grid.origin.cast<float>();
  for (Eigen::Vector3f& x : mesh.positions) x = (x - origin) / static_cast<float>(resolution);
  const Eigen::Array3f most = grid.whole().cast<float>();
  const auto is_outside = [&](const std::array<std::uint32_t, 3>& corners) {
    const Eigen::Array3f a = mesh.positions[corners[0]], b = mesh.positions[corners[1]],
                         c = mesh.positions[corners[2]];
    return (a.max(b).max(c) < 0).any() || (a.min(b).min(c) > most).any();
  };
  std::erase_if(mesh.triangles, is_outside);
  constexpr float kLongest = 0.5F;  // [cells]
  mesh = subdivided(mesh, kLongest);
  std::vector<Eigen::Vector3f> points;
  points.reserve(mesh.triangles.size() * 4);
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f &x = mesh.positions[a], &y = mesh.positions[b], &z = mesh.positions[c];
    points.insert(points.end(), {x, y, z, (x + y + z) / 3});
  }
  return points;
}

}  // namespace

std::string DistanceBox::invalid_reason() const {
  OptionCheck check;
  check.above("resolution", resolution, 0)
      .within("max_distance", max_distance, 0, kFarthestCorner)
      .above("max_distance", max_distance, 0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    check.within("min_corner", min_corner[axis], -kFarthestCorner, kFarthestCorner)
        .within("max_corner", max_corner[axis], -kFarthestCorner, kFarthestCorner);
    check.above("max_corner - min_corner", max_corner[axis] - min_corner[axis], 0);
  }
  if (std::string reason = check.reason(); !reason.empty()) return reason;
  const Eigen::Array3d edges = (vector_of(max_corner) - vector_of(min_corner)).array() + 2 * max_distance;
  return OptionCheck()
      .within("cells of the box and what is within max_distance", (edges / resolution + 4).prod(), 1,
              kMostCells)
      .reason();
}

SpacePoint space_point(const SurfaceVolume& volume, const FreeSpace& free,
                       const std::array<double, 3>& p_world) {
  SpacePoint point;
  const Vector3 x_w = vector_of(p_world);
  const auto found = volume.distance(x_w);
  if (!found) {
    const auto clearance = free.clearance(volume, x_w);
    if (clearance) point = {SpaceState::kFree, *clearance, {0, 0, 0}};
    return point;
  }
  point.state = found->distance > 0 ? SpaceState::kFree : SpaceState::kOccupied;
  point.distance = found->distance;
  point.gradient = {found->gradient.x(), found->gradient.y(), found->gradient.z()};
  return point;
}

DistanceField distance_field(const SurfaceVolume& volume, const FreeSpace& free, const DistanceBox& box) {
  const Grid grid(box);
  const std::vector<SpaceState> states = states_of(volume, free, grid, box.resolution);
  std::vector<Eigen::Vector3f> points = surface_points(volume, grid, box.resolution);
  if (box.unknown_is_obstacle) add_frontier(states, grid.whole(), points);
  const NearestPoints nearest(grid.whole(), points);
  DistanceField field{box.min_corner, box.resolution, {grid.size.x(), grid.size.y(), grid.size.z()}, {}, {}};
  const std::size_t cells = static_cast<std::size_t>(grid.size.cast<std::int64_t>().prod());
  field.states.reserve(cells);
  field.distances.reserve(cells);
  for_each_cell(grid.size, [&](const Eigen::Vector3i& in_box) {
    const Eigen::Vector3i at = in_box.array() + grid.border;
    const SpaceState state = states[grid.number(at)];
    const auto metres = static_cast<float>(
        std::min(static_cast<double>(nearest.distance(at)) * box.resolution, box.max_distance));
    const bool is_obstacle =
        state == SpaceState::kOccupied || (state == SpaceState::kUnknown && box.unknown_is_obstacle);
    field.states.push_back(state);
    field.distances.push_back(is_obstacle ? -metres : metres);
  });
  return field;
}

SpacePoint DistanceField::at(const std::array<double, 3>& p_world) const {
  const Eigen::Array3d in_cells = (vector_of(p_world) - vector_of(min_corner)).array() / resolution;
  const Eigen::Array3d most(size[0], size[1], size[2]);
  if (!(in_cells >= 0).all() || !(in_cells < most).all()) return {};
  const auto number = [&](const Eigen::Array3i& at) {
    return static_cast<std::size_t>(at.x()) +
           static_cast<std::size_t>(size[0]) *
               (static_cast<std::size_t>(at.y()) +
                static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(at.z()));
  };
  SpacePoint point;
  point.state = states[number(in_cells.cast<int>())];
  // Between the middles of eight cells; in the outer half of the outermost cells as at their middles.
  const Eigen::Array3d from_first = (in_cells - 0.5).max(0).min(most - 1);
  const Eigen::Array3i first = from_first.cast<int>().min(most.cast<int>() - 2).max(0);
  const Eigen::Array3d share = from_first - first.cast<double>();
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Array3i step(corner & 1, corner >> 1 & 1, corner >> 2);
    const Eigen::Array3i at = (first + step).min(most.cast<int>() - 1);
    const double value = distances[number(at)];
    const Eigen::Array3d weight = (step == 1).select(share, 1 - share);
    const Eigen::Array3d slope = (step == 1).select(Eigen::Array3d::Ones(), -Eigen::Array3d::Ones());
    point.distance += value * weight.prod();
    for (int axis = 0; axis < 3; ++axis) {
      const double others = weight[(axis + 1) % 3] * weight[(axis + 2) % 3];
      point.gradient[static_cast<std::size_t>(axis)] += value * slope[axis] * others / resolution;
    }
  }
  return point;
}

}  // namespace twofold
