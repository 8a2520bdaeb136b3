#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>

#include "geometry/se3.hpp"
#include "geometry/triangle_mesh.hpp"
#include "surface/depth_view.hpp"
#include "surface/voxel_block.hpp"

namespace twofold {

/// Depth images laid over each other, each moved by its pose, as points (thesis figs. 6.21b, 6.22): what was
/// measured, with whatever poses and depths have wrong, where a mesh shows what agrees. Of the readings that
/// fall into one cell of a grid the mean is kept, so that memory grows with the surface and not with the
/// images.
class RegisteredCloud {
 public:
  /// @param cell  edge [m] > 0
  explicit RegisteredCloud(double cell) : cell_(cell) {}

  /// Adds the readings of an image taken from T_w_c. Cells farther than 2^20 from the origin are left out.
  void add(const DepthView& view, const SE3& T_w_c);
  /// Points with colours, in the order of their cells.
  [[nodiscard]] TriangleMesh points() const;

 private:
  struct Sums {
    Eigen::Vector3d position{0, 0, 0};      ///< [m]
    std::array<std::uint64_t, 3> colour{};  ///< red, green, blue
    std::uint64_t readings = 0;
  };
  struct Hash {
    std::size_t operator()(const BlockPosition& at) const { return hash_of(at); }
  };

  double cell_;
  std::unordered_map<BlockPosition, Sums, Hash> cells_;
};

}  // namespace twofold
