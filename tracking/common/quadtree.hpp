#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "geometry/types.hpp"

namespace twofold {

/// Region quadtree over image points whose traversal returns them spread evenly over the image (thesis 3.4.3,
/// alg. 2): breadth first, and from every inner node met, one leaf below it by depth-first search, children
/// in random order.
///
/// The tree is implicit in the points' order along a Morton curve; buffers are reserved at construction, so
/// that nothing is allocated afterwards. The random order is the same after each clear.
class Quadtree {
 public:
  /// Holds up to `capacity` points of an image of the given size [px].
  Quadtree(int width, int height, std::size_t capacity);

  /// Forgets all points.
  void clear();
  /// Adds a point with the caller's number; false when full or outside the image.
  bool insert(const Eigen::Vector2f& uv, std::uint32_t number);
  /// Number of the next point in equi-distributed order; -1 when all were returned. No insert after the first
  /// next.
  [[nodiscard]] std::int64_t next();
  [[nodiscard]] std::size_t size() const { return leaves_.size(); }

 private:
  static constexpr int kDepth = 8;  ///< smallest region: 1/256 of the image's longer side

  using Leaf = std::uint64_t;  ///< place along the curve in the upper half, number in the lower
  /// Points [begin, end) share the first `depth` quadrants.
  struct Node {
    std::uint32_t begin, end;
    std::int32_t depth;
  };

  void build();
  void sort_along_curve();
  [[nodiscard]] std::uint32_t end_of_quadrant(std::uint32_t begin, std::uint32_t end, int shift) const;
  /// Writes up to four non-empty children of a node, in random order; returns how many.
  int children(const Node& node, Node* result);
  /// In [0, count).
  std::uint32_t random_below(std::uint32_t count) { return static_cast<std::uint32_t>(random_()) % count; }
  std::int64_t take_leaf_below(const Node& node);
  std::int64_t take(const Node& leaf);
  [[nodiscard]] static bool is_leaf(const Node& node) {
    return node.depth == kDepth || node.end - node.begin == 1;
  }

  double cells_per_px_;
  int width_;
  int height_;
  std::vector<Leaf> leaves_, sorted_;
  std::vector<std::uint8_t> visited_;  // of each leaf
  std::vector<Node> level_;            // of the breadth-first search, not yet expanded
  std::vector<Node> next_level_;
  std::array<Node, 4 * kDepth + 4> stack_;  // of the depth-first search
  std::minstd_rand random_;
  bool built_ = false;
};

}  // namespace twofold
