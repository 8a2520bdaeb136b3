#include "surface/free_space/free_space.hpp"

#include <algorithm>
#include <cmath>

#include "base/right_of_way.hpp"
#include "surface/free_space/depth_bounds.hpp"
#include "surface/fusion_view.hpp"
#include "surface/lanes.hpp"

namespace twofold {
namespace {

constexpr double kFarthestCell = 1e8;

BlockPosition to_cell(const Vector3& in_cells) {
  const Eigen::Vector3i whole = in_cells.array().floor().cast<int>();
  return {whole.x(), whole.y(), whole.z()};
}

}  // namespace

class FreeSpace::Look {
 public:
  /// @param frees  what is looked through becomes free
  Look(const DepthView& view, const SurfaceOptions& options, const SE3& T_c_v, double reach, bool frees)
      : frees_(frees),
        view_(view),
        fusion_(view, options, T_c_v),
        bounds_(view),
        T_c_v_(T_c_v),
        T_v_c_(T_c_v.inverse()),
        cell_(kCellEdge * options.voxel) {
    reach_ = bounds_.whole_image().farthest;
    if (reach > 0) reach_ = std::min(reach_, static_cast<float>(reach));
    K_ << fusion_.fx, 0, fusion_.cx + 0.5f, 0, fusion_.fy, fusion_.cy + 0.5f, 0, 0, 1;
    steps_ = K_ * fusion_.R_c_v * static_cast<float>(cell_);
  }

  [[nodiscard]] bool frees() const { return frees_; }
  /// What is seen of a cube. first, edge: [cells]
  [[nodiscard]] Sight at(const Vector3& first, float edge) const {
    constexpr Lanes kX{0, 1, 0, 1, 0, 1, 0, 1}, kY{0, 0, 1, 1, 0, 0, 1, 1}, kZ{0, 0, 0, 0, 1, 1, 1, 1};
    const Eigen::Vector3f corner = K_ * (T_c_v_ * Vector3(first * cell_)).cast<float>();
    const auto corners = [&](int a) {
      return corner[a] + edge * (kX * steps_(a, 0) + kY * steps_(a, 1) + kZ * steps_(a, 2));
    };
    const Lanes uz = corners(0), vz = corners(1), z = corners(2);
    const float near = least(z), far = largest(z);
    if (far <= kLeastDepth || near >= reach_) return Sight::kNone;
    if (largest(uz) < 0 || largest(vz) < 0) return Sight::kNone;
    if (least(uz - fusion_.width * z) >= 0 || least(vz - fusion_.height * z) >= 0) return Sight::kNone;
    if (near <= kLeastDepth) return Sight::kMixed;
    const Lanes u = uz / z, v = vz / z;
    const float left = least(u), top = least(v), right = largest(u), bottom = largest(v);
    const DepthBounds::Range seen =
        bounds_.within(static_cast<int>(std::max(left, 0.0f)), static_cast<int>(std::max(top, 0.0f)),
                       static_cast<int>(std::min(right, fusion_.width - 1)),
                       static_cast<int>(std::min(bottom, fusion_.height - 1)));
    if (near > seen.farthest) return Sight::kHidden;
    const bool is_whole = left >= 0 && top >= 0 && right < fusion_.width && bottom < fusion_.height;
    const bool is_through = is_whole && far <= reach_ && far + fusion_.truncation_at(far) < seen.nearest;
    return is_through ? Sight::kThrough : Sight::kMixed;
  }

  /// Where the reading lies that hides a cell's middle, if all of the cell is behind it.
  [[nodiscard]] std::optional<BlockPosition> hidden_by(const BlockPosition& cell) const {
    const Vector3 middle_c = T_c_v_ * Vector3(Vector3(cell.x + 0.5, cell.y + 0.5, cell.z + 0.5) * cell_);
    const auto uv = view_.camera.find_in_view(middle_c);
    if (!uv) return std::nullopt;
    const double reading = view_.depth.at<float>(static_cast<int>(std::floor(uv->y() + 0.5)),
                                                 static_cast<int>(std::floor(uv->x() + 0.5)));
    const double half_c = 0.5 * cell_ * fusion_.R_c_v.row(2).cwiseAbs().sum();
    if (reading <= 0 || reading > middle_c.z() - half_c) return std::nullopt;
    return to_cell(T_v_c_ * Vector3(middle_c * (reading / middle_c.z())) / cell_);
  }

  /// The corners of all that is seen within reach. [cells]
  void box(Vector3& low, Vector3& high) const {
    low = high = T_v_c_.translation() / cell_;
    const PinholeCamera& camera = view_.camera;
    for (const double u : {-0.5, camera.width - 0.5})
      for (const double v : {-0.5, camera.height - 0.5}) {
        const Vector3 corner =
            T_v_c_ * Vector3(camera.unproject({u, v}) * static_cast<double>(reach_)) / cell_;
        low = low.cwiseMin(corner);
        high = high.cwiseMax(corner);
      }
  }

 private:
  bool frees_;
  const DepthView& view_;
  FusionView fusion_;
  DepthBounds bounds_;
  SE3 T_c_v_, T_v_c_;
  double cell_;  ///< [m]
  float reach_;  ///< [m]
  Eigen::Matrix3f K_;
  Eigen::Matrix3f steps_;  ///< columns: along an edge of a cell (u z, v z, z) grows by so much; u and v are
                           ///< half a pixel more, to be cut off
};

FreeSpace::FreeSpace(const SurfaceOptions& options, double reach) : options_(options), reach_(reach) {}

void FreeSpace::add(const DepthView& view, const SE3& T_c_v) {
  visit_all(Look(view, options_, T_c_v, reach_, true));
}

void FreeSpace::forget_hidden(const DepthView& view, const SE3& T_c_v) {
  if (!groups_.empty()) visit_all(Look(view, options_, T_c_v, 0, false));
}

void FreeSpace::forget_as(const FreeSpace& before) {
  for (const auto& [at, cells] : before.hidden_) {
    hidden_[at] |= cells;
    if (const auto group = groups_.find(at); group != groups_.end()) group->second &= ~cells;
  }
}

void FreeSpace::visit_all(const Look& look) {
  Vector3 low, high;
  look.box(low, high);
  if (!(low.cwiseAbs().cwiseMax(high.cwiseAbs()).maxCoeff() < kFarthestCell)) return;
  std::int32_t edge = kGroupEdge;
  while (2 * edge < (high - low).maxCoeff()) edge *= 2;
  const BlockPosition first = to_cell(low / edge), last = to_cell(high / edge);
  for (std::int32_t z = first.z; z <= last.z; ++z)
    for (std::int32_t y = first.y; y <= last.y; ++y)
      for (std::int32_t x = first.x; x <= last.x; ++x)
        visit(look, {x * edge, y * edge, z * edge}, edge, false);
}

void FreeSpace::visit(const Look& look, const BlockPosition& first, std::int32_t edge, bool hidden) {
  const Sight sight =
      hidden ? Sight::kHidden : look.at(Vector3(first.x, first.y, first.z), static_cast<float>(edge));
  if (sight == Sight::kNone) return;
  if (sight == Sight::kThrough) return look.frees() ? free_all(first, edge) : void();
  if (edge == 1) return forget_if_hidden(look, first);
  if (sight == Sight::kHidden && edge <= kGroupEdge && !groups_.contains(group_of(first))) return;
  const std::int32_t half = edge / 2;
  for (int c = 0; c < 8; ++c)
    visit(look, {first.x + half * (c & 1), first.y + half * (c >> 1 & 1), first.z + half * (c >> 2)}, half,
          sight == Sight::kHidden);
}

void FreeSpace::forget_if_hidden(const Look& look, const BlockPosition& cell) {
  const auto group = groups_.find(group_of(cell));
  if (group == groups_.end() || !group->second[bit_of(cell)]) return;
  const auto hiding = look.hidden_by(cell);
  if (!hiding || !contains(*hiding)) return;
  group->second.reset(bit_of(cell));
  if (!look.frees()) hidden_[group->first].set(bit_of(cell));
}

void FreeSpace::free_all(const BlockPosition& first, std::int32_t edge) {
  const std::int32_t step = std::min(edge, kGroupEdge);
  for (std::int32_t gz = 0; gz < edge; gz += step)
    for (std::int32_t gy = 0; gy < edge; gy += step)
      for (std::int32_t gx = 0; gx < edge; gx += step) {
        const BlockPosition at{first.x + gx, first.y + gy, first.z + gz};
        Group cells;
        for (std::int32_t z = 0; z < step; ++z)
          for (std::int32_t y = 0; y < step; ++y)
            for (std::int32_t x = 0; x < step; ++x) cells.set(bit_of({at.x + x, at.y + y, at.z + z}));
        groups_[group_of(at)] |= cells;
        if (const auto hidden = hidden_.find(group_of(at)); hidden != hidden_.end()) hidden->second &= ~cells;
      }
}

void FreeSpace::add(const FreeSpace& other, const SE3& T_v_o) {
  const double cell = kCellEdge * options_.voxel;
  const SE3 T_o_v = T_v_o.inverse();
  const Matrix3 axes = T_o_v.rotation();
  const double half = 0.5 * kGroupEdge * Vector3(T_v_o.rotation().cwiseAbs().rowwise().sum()).maxCoeff();
  for (const auto& [at, bits] : other.groups_) {
    make_way();
    const Vector3 middle =
        T_v_o * Vector3((Vector3(at.x, at.y, at.z) + Vector3::Constant(0.5)) * kGroupEdge * cell) / cell;
    const BlockPosition first = to_cell(middle.array() - half), last = to_cell(middle.array() + half);
    for (std::int32_t z = first.z; z <= last.z; ++z)
      for (std::int32_t y = first.y; y <= last.y; ++y)
        for (std::int32_t x = first.x; x <= last.x; ++x) {
          const Vector3 middle_v = Vector3(x, y, z) + Vector3::Constant(0.5);
          const Vector3 middle_o = T_o_v * Vector3(middle_v * cell) / cell;
          if (!contains({x, y, z}) && other.holds(middle_o, axes)) free_all({x, y, z}, 1);
        }
  }
}

bool FreeSpace::holds(const Vector3& middle, const Matrix3& axes) const {
  constexpr double kHalf = 0.5 - 1e-6;
  if (!contains(to_cell(middle))) return false;
  for (int c = 0; c < 8; ++c) {
    const Vector3 corner(c & 1 ? kHalf : -kHalf, c & 2 ? kHalf : -kHalf, c & 4 ? kHalf : -kHalf);
    if (!contains(to_cell(middle + axes * corner))) return false;
  }
  return true;
}

bool FreeSpace::contains(const BlockPosition& cell) const {
  const auto group = groups_.find(group_of(cell));
  return group != groups_.end() && group->second[bit_of(cell)];
}

std::optional<double> FreeSpace::clearance(const SurfaceVolume& volume, const Vector3& x_v) const {
  const Vector3 grid = x_v / options_.voxel;
  if (!(grid.array().abs() < kCellEdge * kFarthestCell).all()) return std::nullopt;  // NaN, too
  const BlockPosition base = to_cell(grid);
  double clearance = options_.truncation * options_.voxel;
  for (int c = 0; c < 8; ++c) {
    const std::int32_t x = base.x + (c & 1), y = base.y + (c >> 1 & 1), z = base.z + (c >> 2);
    const VoxelBlock* block = volume.blocks().find({x >> 3, y >> 3, z >> 3});
    if (block == nullptr) {
      if (!contains(to_cell(Vector3(x, y, z) / kCellEdge))) return std::nullopt;
      continue;
    }
    const auto s = static_cast<std::size_t>(((z & 7) * 8 + (y & 7)) * 8 + (x & 7));
    if (block->weight[s] == 0 || block->distance[s] <= 0) return std::nullopt;
    clearance = std::min(clearance, static_cast<double>(volume.units().distance) * block->distance[s]);
  }
  return clearance;
}

std::size_t FreeSpace::bytes() const {
  return bytes_of(groups_) + bytes_of(hidden_);
}

std::size_t FreeSpace::bytes_of(const Groups& groups) {
  return groups.size() * (sizeof(Groups::value_type) + 2 * sizeof(void*)) +
         (groups.empty() ? 0 : groups.bucket_count() * sizeof(void*));
}

BlockPosition FreeSpace::group_of(const BlockPosition& cell) {
  static_assert(kGroupEdge == 8);
  return {cell.x >> 3, cell.y >> 3, cell.z >> 3};
}

std::size_t FreeSpace::bit_of(const BlockPosition& cell) {
  return static_cast<std::size_t>(((cell.z & 7) * 8 + (cell.y & 7)) * 8 + (cell.x & 7));
}

}  // namespace twofold
