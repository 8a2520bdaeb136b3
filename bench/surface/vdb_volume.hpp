#pragma once

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "geometry/se3.hpp"
#include "surface/depth_view.hpp"

namespace twofold {

/// The leaves of 8^3 samples that a view's readings touch, within the truncation before and behind them.
inline std::set<openvdb::Coord> vdb_leaves_of(const DepthView& view, const SE3& T_w_c, double voxel,
                                              double truncation) {
  std::set<openvdb::Coord> leaves;
  constexpr int kStep = 2;  // pixels, as in surface/block_search.cpp
  for (int y = 0; y < view.depth.rows; y += kStep) {
    for (int x = 0; x < view.depth.cols; x += kStep) {
      const double z = view.depth.at<float>(y, x);
      if (!(z > 0)) continue;
      const Vector3 ray = view.camera.unproject(Vector2(x, y));
      for (double at = z - truncation; at <= z + truncation; at += 4 * voxel) {
        const Vector3 grid = T_w_c * Vector3(at * ray) / voxel;
        leaves.insert(openvdb::Coord(static_cast<int>(std::floor(grid.x())) & ~7,
                                     static_cast<int>(std::floor(grid.y())) & ~7,
                                     static_cast<int>(std::floor(grid.z())) & ~7));
      }
    }
  }
  return leaves;
}

/// Distances in one grid of floats, weights in another, colours in a third, as vdbfusion has it for laser
/// scans: a depth image's samples along each ray within the truncation, each reading of weight 1.
class VdbVolume {
 public:
  /// @param voxel       [m]
  /// @param truncation  [voxels]
  VdbVolume(double voxel, double truncation)
      : voxel_(voxel),
        truncation_(truncation * voxel),
        distances_(openvdb::FloatGrid::create(static_cast<float>(truncation_))),
        weights_(openvdb::FloatGrid::create(0)),
        colours_(openvdb::Vec3SGrid::create()) {}

  void fuse(const DepthView& view, const SE3& T_c_w) {
    for (const openvdb::Coord& leaf : vdb_leaves_of(view, T_c_w.inverse(), voxel_, truncation_))
      fuse_leaf(view, T_c_w, leaf);
  }

  [[nodiscard]] const openvdb::FloatGrid& distances() const { return *distances_; }
  [[nodiscard]] const openvdb::FloatGrid& weights() const { return *weights_; }  ///< 0: never seen
  [[nodiscard]] const openvdb::Vec3SGrid& colours() const { return *colours_; }  ///< red, green, blue

 private:
  void fuse_leaf(const DepthView& view, const SE3& T_c_w, const openvdb::Coord& origin) {
    auto* distances = distances_->tree().touchLeaf(origin);
    auto* weights = weights_->tree().touchLeaf(origin);
    auto* colours = colours_->tree().touchLeaf(origin);
    for (openvdb::Index i = 0; i < 512; ++i) {
      const openvdb::Coord at = distances->offsetToGlobalCoord(i);
      const Vector3 x_c = T_c_w * Vector3(voxel_ * Vector3(at.x(), at.y(), at.z()));
      const auto uv = view.camera.find_in_view(x_c);
      if (!uv) continue;
      const int u = static_cast<int>(uv->x() + 0.5), v = static_cast<int>(uv->y() + 0.5);
      const float z = view.depth.at<float>(v, u);
      if (!(z > 0)) continue;
      const auto distance = static_cast<float>((z - x_c.z()) * x_c.norm() / x_c.z());  // along the ray
      if (distance < -truncation_) continue;
      const float w = weights->getValue(i);
      const float bounded = std::min(distance, static_cast<float>(truncation_));
      distances->setValueOn(i, (w * distances->getValue(i) + bounded) / (w + 1));
      weights->setValueOn(i, w + 1);
      const auto& bgr = view.colour.at<cv::Vec3b>(v, u);
      const openvdb::Vec3s colour(bgr[2], bgr[1], bgr[0]);
      colours->setValueOn(i, (colours->getValue(i) * w + colour) / (w + 1));
    }
  }

  double voxel_, truncation_;
  openvdb::FloatGrid::Ptr distances_, weights_;
  openvdb::Vec3SGrid::Ptr colours_;
};

}  // namespace twofold
