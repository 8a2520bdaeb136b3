#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace twofold {

/// For each cell of a grid how far the nearest of some points is from the cell's middle, whichever way it
/// lies. The nearest cell that holds a point is found for all cells at once (Felzenszwalb and Huttenlocher,
/// Distance transforms of sampled functions, 2012), in time linear in the cells; then the points in it and in
/// those that the neighbours found are compared. So what is nearest is missed only where two points are
/// nearly equally far, and by a fraction of a cell.
class NearestPoints {
 public:
  /// @param size    cells along x, y, z, >= 1
  /// @param points  in cells: cell (i, j, k) reaches from there to (i + 1, j + 1, k + 1). Points outside the
  ///                grid are left out
  NearestPoints(const Eigen::Vector3i& size, std::span<const Eigen::Vector3f> points);

  /// From the cell's middle [cells], infinite if there is no point at all.
  [[nodiscard]] float distance(const Eigen::Vector3i& cell) const;

 private:
  static constexpr std::uint32_t kNone = 0xffffffff;
  [[nodiscard]] std::uint32_t index_of(const Eigen::Vector3i& cell) const {
    return (static_cast<std::uint32_t>(cell.z()) * static_cast<std::uint32_t>(size_.y()) +
            static_cast<std::uint32_t>(cell.y())) *
               static_cast<std::uint32_t>(size_.x()) +
           static_cast<std::uint32_t>(cell.x());
  }
  [[nodiscard]] bool contains(const Eigen::Vector3i& cell) const {
    return (cell.array() >= 0).all() && (cell.array() < size_.array()).all();
  }
  void sort_into_cells(std::span<const Eigen::Vector3f> points);
  void spread_along(int axis);

  Eigen::Vector3i size_;
  std::vector<Eigen::Vector3f> points_;      ///< ordered by their cells
  std::vector<std::uint32_t> first_point_;   ///< of each cell, and of the end
  std::vector<std::uint32_t> nearest_cell_;  ///< with a point, along the axes that were spread along
};

}  // namespace twofold
