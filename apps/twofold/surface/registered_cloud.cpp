#include "apps/twofold/surface/registered_cloud.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace twofold {
namespace {

constexpr double kMostCells = 1 << 20;  // from the origin

}  // namespace

void RegisteredCloud::add(const DepthView& view, const SE3& T_w_c) {
  for (int y = 0; y < view.depth.rows; ++y) {
    for (int x = 0; x < view.depth.cols; ++x) {
      const PixelReading& pixel = view.pixel(y, x);
      if (!(pixel.depth > 0)) continue;
      const Vector3 x_w = T_w_c * Vector3(pixel.depth * view.camera.unproject(Vector2(x, y)));
      const Vector3 cell = (x_w / cell_).array().floor();
      if (!(cell.cwiseAbs().maxCoeff() < kMostCells)) continue;
      Sums& sums = cells_[{static_cast<std::int32_t>(cell.x()), static_cast<std::int32_t>(cell.y()),
                           static_cast<std::int32_t>(cell.z())}];
      sums.position += x_w;
      for (std::size_t channel = 0; channel < 3; ++channel)
        sums.colour[channel] += pixel.colour_and_facing >> (8 * channel) & 0xffU;
      ++sums.readings;
    }
  }
}

TriangleMesh RegisteredCloud::points() const {
  std::vector<std::pair<BlockPosition, Sums>> ordered(cells_.begin(), cells_.end());
  std::sort(ordered.begin(), ordered.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  TriangleMesh cloud;
  for (const auto& [cell, sums] : ordered) {
    cloud.positions.emplace_back((sums.position / static_cast<double>(sums.readings)).cast<float>());
    auto& colour = cloud.colours.emplace_back();
    for (std::size_t channel = 0; channel < 3; ++channel)
      colour[channel] = static_cast<std::uint8_t>(sums.colour[channel] / sums.readings);
  }
  return cloud;
}

}  // namespace twofold
