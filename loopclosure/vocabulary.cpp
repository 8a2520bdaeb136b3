#include "loopclosure/vocabulary.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace twofold {

double bag_score(const BagOfWords& a, const BagOfWords& b) {
  // For bags of sum 1: 1 - |a - b| / 2 = sum over shared words of min(a, b).
  double shared = 0;
  auto i = a.begin();
  auto j = b.begin();
  while (i != a.end() && j != b.end()) {
    if (i->first < j->first) {
      ++i;
    } else if (j->first < i->first) {
      ++j;
    } else {
      shared += std::min(i->second, j->second);
      ++i;
      ++j;
    }
  }
  return shared;
}

Vocabulary::Vocabulary(std::vector<Node> nodes) : nodes_(std::move(nodes)) {
  if (nodes_.empty() || nodes_[0].child_count == 0) throw std::runtime_error("vocabulary without words");
  // Children stand after their parent, each node has one parent: so every descent ends, and every node is
  // reached.
  std::vector<int> depth(nodes_.size(), -1);
  depth[0] = 0;
  std::size_t next = 1;
  std::size_t words = 0;
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    const Node& node = nodes_[n];
    if (depth[n] < 0) throw std::runtime_error("vocabulary node without a parent");
    if (node.child_count == 0) {
      if (node.word != words || !std::isfinite(node.idf) || node.idf < 0) {
        throw std::runtime_error("vocabulary word out of order or with a bad weight");
      }
      ++words;
      continue;
    }
    if (node.first_child != next || node.child_count > nodes_.size() - next) {
      throw std::runtime_error("vocabulary children out of order");
    }
    for (std::size_t c = next; c < next + node.child_count; ++c) depth[c] = depth[n] + 1;
    depth_ = std::max(depth_, depth[n] + 1);
    next += node.child_count;
  }
  word_count_ = words;
}

std::size_t Vocabulary::leaf(const BinaryDescriptor& descriptor) const {
  std::size_t at = 0;
  while (nodes_[at].child_count > 0) {
    const Node& node = nodes_[at];
    std::size_t best = node.first_child;
    int best_distance = 257;
    for (std::size_t c = node.first_child; c < node.first_child + node.child_count; ++c) {
      const int distance = hamming_distance(descriptor, nodes_[c].descriptor);
      if (distance < best_distance) {
        best_distance = distance;
        best = c;
      }
    }
    at = best;
  }
  return at;
}

BagOfWords Vocabulary::bag(std::span<const DescribedCorner> corners) const {
  std::vector<std::pair<WordId, float>> counted;
  counted.reserve(corners.size());
  for (const DescribedCorner& corner : corners) {
    const Node& node = nodes_[leaf(corner.descriptor)];
    if (node.idf > 0) counted.emplace_back(node.word, node.idf);
  }
  std::sort(counted.begin(), counted.end());
  BagOfWords bag;
  double total = 0;
  for (const auto& [word, idf] : counted) {
    if (bag.empty() || bag.back().first != word) bag.emplace_back(word, 0.0F);
    bag.back().second += idf;
    total += idf;
  }
  for (auto& entry : bag) entry.second = static_cast<float>(entry.second / total);
  return bag;
}

}  // namespace twofold
