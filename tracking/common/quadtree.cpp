#include "tracking/common/quadtree.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

namespace twofold {
namespace {

/// Spreads the low 8 bits to the even positions.
std::uint32_t spread(std::uint32_t x) {
  x = (x | (x << 4)) & 0x0f0fU;
  x = (x | (x << 2)) & 0x3333U;
  return (x | (x << 1)) & 0x5555U;
}

}  // namespace

Quadtree::Quadtree(int width, int height, std::size_t capacity)
    : cells_per_px_((1 << kDepth) / static_cast<double>(std::max(width, height))),
      width_(width),
      height_(height) {
  leaves_.reserve(capacity);
  sorted_.reserve(capacity);
  visited_.reserve(capacity);
  level_.reserve(capacity + 4);
  next_level_.reserve(capacity + 4);
}

void Quadtree::clear() {
  leaves_.clear();
  level_.clear();
  next_level_.clear();
  random_.seed(1);
  built_ = false;
}

bool Quadtree::insert(const Eigen::Vector2f& uv, std::uint32_t number) {
  if (leaves_.size() == leaves_.capacity()) return false;
  if (!(uv.x() >= 0 && uv.y() >= 0 && uv.x() < static_cast<float>(width_) &&
        uv.y() < static_cast<float>(height_))) {
    return false;
  }
  const auto x = static_cast<std::uint32_t>(uv.x() * cells_per_px_);
  const auto y = static_cast<std::uint32_t>(uv.y() * cells_per_px_);
  leaves_.push_back(Leaf{spread(x) | (spread(y) << 1)} << 32 | number);
  return true;
}

/// By the places' lower byte, then by the upper one, each time keeping the order of those that are equal:
/// points that share a place stay as they were inserted.
void Quadtree::sort_along_curve() {
  sorted_.resize(leaves_.size());
  for (const int shift : {32, 40}) {
    const auto key = [shift](Leaf leaf) { return static_cast<std::uint8_t>(leaf >> shift); };
    std::array<std::uint32_t, 257> begin{};
    for (const Leaf leaf : leaves_) ++begin[key(leaf) + 1U];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    for (const Leaf leaf : leaves_) sorted_[begin[key(leaf)]++] = leaf;
    std::swap(leaves_, sorted_);
  }
}

void Quadtree::build() {
  sort_along_curve();
  visited_.assign(leaves_.size(), 0);
  if (!leaves_.empty()) level_.push_back({0, static_cast<std::uint32_t>(leaves_.size()), 0});
  built_ = true;
}

/// First leaf in [begin, end) that is not in the quadrant of the first. Few leaves are looked at one by one;
/// many are halved.
std::uint32_t Quadtree::end_of_quadrant(std::uint32_t begin, std::uint32_t end, int shift) const {
  constexpr std::uint32_t kFew = 12;
  const Leaf quadrant = leaves_[begin] >> (32 + shift);
  const auto is_inside = [&](std::uint32_t i) { return leaves_[i] >> (32 + shift) == quadrant; };
  if (is_inside(end - 1)) return end;
  std::uint32_t inside = begin;
  while (end - inside > kFew) {
    const std::uint32_t middle = inside + (end - inside) / 2;
    (is_inside(middle) ? inside : end) = middle;
  }
  while (is_inside(inside)) ++inside;  // the last one is not
  return inside;
}

int Quadtree::children(const Node& node, Node* result) {
  const int shift = 2 * (kDepth - 1 - node.depth);
  int count = 0;
  std::uint32_t begin = node.begin;
  while (begin < node.end) {
    const std::uint32_t end = end_of_quadrant(begin, node.end, shift);
    result[count++] = {begin, end, node.depth + 1};
    begin = end;
  }
  for (std::uint32_t left = static_cast<std::uint32_t>(count); left > 1; --left)
    std::swap(result[left - 1], result[random_below(left)]);
  return count;
}

std::int64_t Quadtree::take(const Node& leaf) {
  // Points closer together than the smallest region share a leaf; each is a leaf of its own in turn.
  for (std::uint32_t i = leaf.begin; i < leaf.end; ++i) {
    if (visited_[i] == 0) {
      visited_[i] = 1;
      return static_cast<std::uint32_t>(leaves_[i]);
    }
  }
  return -1;
}

std::int64_t Quadtree::take_leaf_below(const Node& node) {
  std::size_t size = 0;
  stack_[size++] = node;
  while (size > 0) {
    const Node top = stack_[--size];
    if (!is_leaf(top)) {
      size += static_cast<std::size_t>(children(top, &stack_[size]));
    } else if (const std::int64_t number = take(top); number >= 0) {
      return number;
    }
  }
  return -1;
}

std::int64_t Quadtree::next() {
  if (!built_) build();
  for (;;) {
    if (level_.empty()) {
      if (next_level_.empty()) return -1;
      std::swap(level_, next_level_);
    }
    std::swap(level_[random_below(static_cast<std::uint32_t>(level_.size()))], level_.back());
    const Node node = level_.back();
    if (is_leaf(node)) {
      const std::int64_t number = take(node);
      if (number >= 0) return number;
      level_.pop_back();
      continue;
    }
    level_.pop_back();
    Node below[4];
    const int count = children(node, below);
    for (int i = 0; i < count; ++i) next_level_.push_back(below[i]);
    const std::int64_t number = take_leaf_below(node);
    if (number >= 0) return number;
  }
}

}  // namespace twofold
