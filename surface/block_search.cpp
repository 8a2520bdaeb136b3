// Which blocks a depth image says something about.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "base/right_of_way.hpp"
#include "surface/fusion_view.hpp"
#include "surface/lanes.hpp"
#include "surface/volume.hpp"

namespace twofold {
namespace {

constexpr int kPixelStep = 2;        // between readings that blocks are made for: a block is wider
constexpr float kWideBlock = 12.0f;  // [px]: every second of these rows is enough for blocks at least so wide
constexpr int kGroup = kLanes * kPixelStep;

inline LaneIndex floor_of(const Lanes& a) {
  const LaneIndex toward_zero = whole(a);
  return toward_zero + (real(toward_zero) > a);  // a comparison gives -1
}

/// Blocks met by the readings of the row before, at one step along the rays: readings beside each other meet
/// the same blocks, and only what neither the left nor the upper neighbour met is looked up. All that stands
/// here was touched, or is nowhere.
class LastBlocks {
 public:
  explicit LastBlocks(std::size_t readings)
      : x_(readings + 1, kNowhere), y_(readings + 1, kNowhere), z_(readings + 1, kNowhere) {}

  /// Takes over the blocks of eight readings from `first` on where `valid`; which of them are new.
  LaneIndex replace(std::size_t first, const LaneIndex& valid, LaneIndex& x, LaneIndex& y, LaneIndex& z) {
    LaneIndex same = ~valid;
    {
      const auto ux = above(x_, first), uy = above(y_, first), uz = above(z_, first);
      same |= (ux == x) & (uy == y) & (uz == z);
      store(x_, first, valid ? x : ux);
      store(y_, first, valid ? y : uy);
      store(z_, first, valid ? z : uz);
    }
    same |= (left(x_, first) == x) & (left(y_, first) == y) & (left(z_, first) == z);
    return ~same;
  }

 private:
  static constexpr std::int32_t kNowhere = std::numeric_limits<std::int32_t>::min();
  static LaneIndex above(const std::vector<std::int32_t>& of, std::size_t first) {
    return load<LaneIndex>(&of[first + 1]);
  }
  static LaneIndex left(const std::vector<std::int32_t>& of, std::size_t first) {
    return load<LaneIndex>(&of[first]);
  }
  static void store(std::vector<std::int32_t>& to, std::size_t first, const LaneIndex& lanes) {
    std::memcpy(&to[first + 1], &lanes, sizeof(lanes));
  }

  std::vector<std::int32_t> x_, y_, z_;  // one reading to the right
};

/// Every kPixelStep-th reading of a row from x on; 0 beyond its end.
inline Lanes every_second(const float* row, int x, int width) {
  static_assert(kPixelStep == 2);
  if (x + kGroup <= width) {
    return __builtin_shufflevector(load<Lanes>(row + x), load<Lanes>(row + x + kLanes), 0, 2, 4, 6, 8, 10, 12,
                                   14);
  }
  Lanes z{};
  for (int i = 0; i < kLanes && x + kPixelStep * i < width; ++i) z[i] = row[x + kPixelStep * i];
  return z;
}

}  // namespace

/// Along the ray of a reading, from the truncation in front of it to that behind, in steps of half a block.
void SurfaceVolume::collect_blocks(const DepthView& view, const SE3& T_c_v) {
  const FusionView f(view, options_, T_c_v);
  const float blocks_a_metre = 1 / (f.voxel * kBlockEdge);
  const Eigen::Matrix3f R_v_c = f.R_c_v.transpose() * blocks_a_metre;
  const Eigen::Vector3f eye = T_c_v.inverse().translation().cast<float>() * blocks_a_metre;
  const auto max_depth = static_cast<float>(options_.max_depth > 0 ? options_.max_depth : 1e9);
  touch_none();
  const auto groups = static_cast<std::size_t>((view.depth.cols + kGroup - 1) / kGroup);
  std::vector<LastBlocks> last;
  for (int y = 0; y < view.depth.rows; y += kPixelStep) {
    make_way();
    const auto* row = view.depth.ptr<float>(y);
    const float ry = (static_cast<float>(y) - f.cy) / f.fy;
    const float nearest = y % (2 * kPixelStep) == 0 ? 0 : f.fx * f.voxel * kBlockEdge / kWideBlock;
    for (int x = 0; x < view.depth.cols; x += kGroup) {
      const Lanes z = every_second(row, x, view.depth.cols);
      const LaneIndex valid = (z > nearest) & (z <= max_depth);
      if (!any(valid)) continue;
      const Lanes rx = (static_cast<float>(x) + kPixelStep * kCount - f.cx) / f.fx;
      // How far the rays reach, in depth: the band is as wide as it is for the farthest of them.
      const float shortest = std::sqrt(1 + ry * ry + least(rx * rx));
      const float reach = f.truncation_at(largest(valid ? z : kZero)) / shortest;
      const int steps = std::max(2, static_cast<int>(std::ceil(4 * reach * blocks_a_metre)));
      while (last.size() <= static_cast<std::size_t>(steps)) last.emplace_back(groups * kLanes);
      for (int s = 0; s <= steps; ++s) {
        const Lanes at = z + reach * (2 * static_cast<float>(s) / static_cast<float>(steps) - 1);
        std::array<LaneIndex, 3> block;
        for (int a = 0; a < 3; ++a)
          block[static_cast<std::size_t>(a)] =
              floor_of(eye[a] + at * (R_v_c(a, 0) * rx + (R_v_c(a, 1) * ry + R_v_c(a, 2))));
        const LaneIndex is_new = last[static_cast<std::size_t>(s)].replace(
            static_cast<std::size_t>(x / kPixelStep), valid, block[0], block[1], block[2]);
        if (!any(is_new)) continue;
        for (int i = 0; i < kLanes; ++i)
          if (is_new[i] != 0) touch({block[0][i], block[1][i], block[2][i]});
      }
    }
  }
}

/// Blocks in front of what is seen, as far as their centres tell.
void SurfaceVolume::add_blocks_to_carve(const DepthView& view, const SE3& T_c_v) {
  const double edge = kBlockEdge * options_.voxel;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (is_touched_[b] != 0) continue;
    const BlockHead& block = blocks_.head(b);
    if (block.all_free) continue;
    const Vector3 centre(block.at.x + 0.5, block.at.y + 0.5, block.at.z + 0.5);
    const Vector3 centre_c = T_c_v * Vector3(centre * edge);
    const auto uv = view.camera.find_in_view(centre_c);
    if (!uv) continue;
    const float seen = view.pixel(static_cast<int>(uv->y() + 0.5), static_cast<int>(uv->x() + 0.5)).nearest;
    make_way();
    if (seen < centre_c.z() - edge) continue;
    touched_.push_back(static_cast<std::uint32_t>(b));
  }
}

}  // namespace twofold
