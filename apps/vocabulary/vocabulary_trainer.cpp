#include "apps/vocabulary/vocabulary_trainer.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>

#include "base/check.hpp"
#include "base/option_check.hpp"

namespace twofold {
namespace {

using Members = std::vector<const BinaryDescriptor*>;

struct Cluster {
  BinaryDescriptor median;
  Members members;
};

BinaryDescriptor median_of(const Members& members) {
  std::array<int, 256> ones{};
  for (const BinaryDescriptor* d : members) {
    for (std::size_t b = 0; b < 256; ++b) ones[b] += static_cast<int>(d->bits[b / 64] >> (b % 64) & 1U);
  }
  BinaryDescriptor median;
  for (std::size_t b = 0; b < 256; ++b) {
    const bool set = 2 * static_cast<std::size_t>(ones[b]) > members.size();
    median.bits[b / 64] |= static_cast<std::uint64_t>(set) << (b % 64);
  }
  return median;
}

/// k-means++: each next centre is drawn with probability proportional to the squared distance to the nearest
/// one.
std::vector<BinaryDescriptor> seed_centres(const Members& members, int count, std::mt19937& rng) {
  std::vector<BinaryDescriptor> centres{*members[rng() % members.size()]};
  std::vector<std::uint64_t> nearest(members.size(), ~std::uint64_t{0});
  while (static_cast<int>(centres.size()) < count) {
    std::uint64_t total = 0;
    for (std::size_t m = 0; m < members.size(); ++m) {
      const auto d = static_cast<std::uint64_t>(hamming_distance(*members[m], centres.back()));
      nearest[m] = std::min(nearest[m], d * d);
      total += nearest[m];
    }
    if (total == 0) break;  // fewer different descriptors than centres
    const auto upper = static_cast<std::uint64_t>(rng());
    const std::uint64_t draw = (upper << 32 | rng()) % total;
    std::uint64_t sum = 0;
    std::size_t chosen = 0;
    while ((sum += nearest[chosen]) <= draw) ++chosen;
    centres.push_back(*members[chosen]);
  }
  return centres;
}

std::size_t nearest_centre(const BinaryDescriptor& descriptor, const std::vector<BinaryDescriptor>& centres) {
  const auto nearer = [&](const BinaryDescriptor& a, const BinaryDescriptor& b) {
    return hamming_distance(descriptor, a) < hamming_distance(descriptor, b);
  };
  return static_cast<std::size_t>(std::min_element(centres.begin(), centres.end(), nearer) - centres.begin());
}

std::vector<Cluster> k_medians(const Members& members, const VocabularyTrainerOptions& options,
                               std::mt19937& rng) {
  std::vector<BinaryDescriptor> centres = seed_centres(members, options.branching, rng);
  std::vector<std::size_t> assigned(members.size(), centres.size());
  std::vector<Members> groups;
  for (int iteration = 0; iteration <= options.iterations; ++iteration) {
    bool moved = false;
    groups.assign(centres.size(), {});
    for (std::size_t m = 0; m < members.size(); ++m) {
      const std::size_t centre = nearest_centre(*members[m], centres);
      moved |= centre != assigned[m];
      assigned[m] = centre;
      groups[centre].push_back(members[m]);
    }
    if (!moved || iteration == options.iterations) break;
    for (std::size_t c = 0; c < centres.size(); ++c) {
      if (!groups[c].empty()) centres[c] = median_of(groups[c]);
    }
  }
  std::vector<Cluster> clusters;
  for (std::size_t c = 0; c < centres.size(); ++c) {
    if (!groups[c].empty()) clusters.push_back({centres[c], std::move(groups[c])});
  }
  return clusters;
}

/// Nodes in breadth-first order, so that the children of each stand together.
std::vector<Vocabulary::Node> grow_tree(const Members& all, const VocabularyTrainerOptions& options) {
  std::mt19937 rng(options.seed);
  std::vector<Vocabulary::Node> nodes(1);
  std::vector<Members> members{all};
  std::size_t level_begin = 0;
  for (int level = 0; level < options.levels; ++level) {
    const std::size_t level_end = nodes.size();
    for (std::size_t n = level_begin; n < level_end; ++n) {
      std::vector<Cluster> clusters = k_medians(members[n], options, rng);
      members[n].clear();
      if (clusters.size() < 2 && n != 0) continue;  // nothing left to part: the node is a word
      nodes[n].first_child = static_cast<std::uint32_t>(nodes.size());
      nodes[n].child_count = static_cast<std::uint32_t>(clusters.size());
      for (Cluster& cluster : clusters) {
        nodes.push_back({.descriptor = cluster.median});
        members.push_back(std::move(cluster.members));
      }
    }
    level_begin = level_end;
  }
  WordId word = 0;
  for (Vocabulary::Node& node : nodes) {
    if (node.child_count == 0) node.word = word++;
  }
  return nodes;
}

}  // namespace

std::string VocabularyTrainerOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("branching", branching, 2)
      .within("levels", levels, 1, 6)
      .at_least("iterations", iterations, 1)
      .reason();
}

Vocabulary train_vocabulary(const std::vector<std::vector<BinaryDescriptor>>& images,
                            const VocabularyTrainerOptions& options) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "vocabulary trainer options");
  Members all;
  for (const auto& image : images) {
    for (const BinaryDescriptor& descriptor : image) all.push_back(&descriptor);
  }
  const bool different =
      std::any_of(all.begin(), all.end(), [&](const auto* d) { return !(*d == *all.front()); });
  if (!different) throw std::runtime_error("vocabulary training needs at least two different descriptors");
  std::vector<Vocabulary::Node> nodes = grow_tree(all, options);
  const Vocabulary unweighted(nodes);

  std::vector<int> documents(unweighted.word_count(), 0);
  for (const auto& image : images) {
    std::vector<WordId> words;
    words.reserve(image.size());
    for (const BinaryDescriptor& descriptor : image) words.push_back(unweighted.word(descriptor));
    std::sort(words.begin(), words.end());
    words.erase(std::unique(words.begin(), words.end()), words.end());
    for (const WordId word : words) ++documents[word];
  }
  for (Vocabulary::Node& node : nodes) {
    if (node.child_count > 0) continue;
    const int count = std::max(1, documents[node.word]);
    node.idf = static_cast<float>(std::log(static_cast<double>(images.size()) / count));
  }
  return Vocabulary(std::move(nodes));
}

}  // namespace twofold
