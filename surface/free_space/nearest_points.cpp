#include "surface/free_space/nearest_points.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>

#include "base/check.hpp"

namespace twofold {
namespace {

/// One line of cells: which of the parabolas (x - middle)^2 + height is the lowest at each of them.
class LowerEnvelope {
 public:
  explicit LowerEnvelope(int longest)
      : middles_(static_cast<std::size_t>(longest)), begins_(static_cast<std::size_t>(longest) + 1) {}

  void clear() { count_ = 0; }
  /// In ascending order of the middles. @param height  of the parabola's foot
  void add(int middle, double height) {
    double begin = -std::numeric_limits<double>::infinity();
    while (count_ > 0) {
      const Parabola& last = middles_[count_ - 1];
      begin = (height - last.height + middle * middle - last.middle * last.middle) /
              (2.0 * (middle - last.middle));
      if (begin > begins_[count_ - 1]) break;
      --count_;  // nowhere the lowest
      begin = -std::numeric_limits<double>::infinity();
    }
    middles_[count_] = {middle, height};
    begins_[count_] = begin;
    ++count_;
  }
  /// visit(x, middle of the lowest parabola there) for x = 0 .. length - 1, if there is a parabola at all.
  template <class Visit>
  void for_each(int length, Visit&& visit) const {
    if (count_ == 0) return;
    std::size_t k = 0;
    for (int x = 0; x < length; ++x) {
      while (k + 1 < count_ && begins_[k + 1] < x) ++k;
      visit(x, middles_[k].middle);
    }
  }

 private:
  struct Parabola {
    int middle = 0;
    double height = 0;
  };
  std::vector<Parabola> middles_;
  std::vector<double> begins_;  ///< from where on each is the lowest
  std::size_t count_ = 0;
};

}  // namespace

NearestPoints::NearestPoints(const Eigen::Vector3i& size, std::span<const Eigen::Vector3f> points)
    : size_(size) {
  TWOFOLD_CHECK((size.array() >= 1).all() && size.cast<double>().prod() < kNone,
                "a grid has cells, and their numbers 32 bits");
  sort_into_cells(points);
  nearest_cell_.assign(first_point_.size() - 1, kNone);
  for (std::uint32_t cell = 0; cell < nearest_cell_.size(); ++cell) {
    if (first_point_[cell] != first_point_[cell + 1]) nearest_cell_[cell] = cell;
  }
  for (int axis = 0; axis < 3; ++axis) spread_along(axis);
}

void NearestPoints::sort_into_cells(std::span<const Eigen::Vector3f> points) {
  const auto cell_of = [&](const Eigen::Vector3f& x) -> std::uint32_t {
    // Compared before they are made whole numbers, which the farthest ones have no room in.
    if (!(x.array() >= 0).all() || !(x.array() < size_.cast<float>().array()).all()) return kNone;
    const Eigen::Vector3i cell = x.cast<int>();
    return contains(cell) ? index_of(cell) : kNone;
  };
  const auto cells = static_cast<std::size_t>(size_.cast<std::int64_t>().prod());
  first_point_.assign(cells + 1, 0);
  for (const Eigen::Vector3f& x : points) {
    if (const std::uint32_t cell = cell_of(x); cell != kNone) ++first_point_[cell + 1];
  }
  std::partial_sum(first_point_.begin(), first_point_.end(), first_point_.begin());
  std::vector<std::uint32_t> next(first_point_.begin(), first_point_.end() - 1);
  points_.resize(first_point_.back());
  for (const Eigen::Vector3f& x : points) {
    if (const std::uint32_t cell = cell_of(x); cell != kNone) points_[next[cell]++] = x;
  }
}

/// Each line along the axis on its own: what was nearest along the axes before is as high as that is far.
void NearestPoints::spread_along(int axis) {
  const int length = size_[axis];
  const int across = (axis + 1) % 3, beyond = (axis + 2) % 3;
  LowerEnvelope envelope(length);
  std::vector<std::uint32_t> line(static_cast<std::size_t>(length));
  Eigen::Vector3i cell;
  const auto middle_of = [&](std::uint32_t index) -> Eigen::Vector3i {
    const auto x = static_cast<std::uint32_t>(size_.x()), y = static_cast<std::uint32_t>(size_.y());
    return {static_cast<int>(index % x), static_cast<int>(index / x % y), static_cast<int>(index / x / y)};
  };
  for (cell[beyond] = 0; cell[beyond] < size_[beyond]; ++cell[beyond]) {
    for (cell[across] = 0; cell[across] < size_[across]; ++cell[across]) {
      envelope.clear();
      for (cell[axis] = 0; cell[axis] < length; ++cell[axis]) {
        const std::uint32_t nearest = nearest_cell_[index_of(cell)];
        line[static_cast<std::size_t>(cell[axis])] = nearest;
        if (nearest == kNone) continue;
        envelope.add(cell[axis], (middle_of(nearest) - cell).cast<double>().squaredNorm());
      }
      envelope.for_each(length, [&](int x, int lowest) {
        cell[axis] = x;
        nearest_cell_[index_of(cell)] = line[static_cast<std::size_t>(lowest)];
      });
    }
  }
}

float NearestPoints::distance(const Eigen::Vector3i& cell) const {
  static const std::array<Eigen::Vector3i, 7> kAround{
      Eigen::Vector3i(0, 0, 0), {-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}};
  const Eigen::Vector3f middle = cell.cast<float>().array() + 0.5F;
  float least = std::numeric_limits<float>::infinity();
  std::uint32_t before = kNone;  // mostly the neighbours found the same
  for (const Eigen::Vector3i& step : kAround) {
    if (!contains(cell + step)) continue;
    const std::uint32_t nearest = nearest_cell_[index_of(cell + step)];
    if (nearest == kNone || nearest == before) continue;
    before = nearest;
    for (std::uint32_t p = first_point_[nearest]; p < first_point_[nearest + 1]; ++p)
      least = std::min(least, (points_[p] - middle).squaredNorm());
  }
  return std::sqrt(least);
}

}  // namespace twofold
