#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include "imaging/binary_descriptor.hpp"

namespace twofold {

using WordId = std::uint32_t;

/// Bag of words: words ascending, tf-idf weights > 0 that add up to 1; empty if no word has weight.
using BagOfWords = std::vector<std::pair<WordId, float>>;

/// Likeness of two bags in [0, 1]: 1 - |a - b|_1 / 2  (Nister and Stewenius, CVPR 2006).
[[nodiscard]] double bag_score(const BagOfWords& a, const BagOfWords& b);

/// Tree of binary words (thesis 6.4.2 with binary descriptors): every inner node has up to `branching`
/// children, each with a median descriptor; the leaves are the words, weighted by inverse document frequency.
///
/// Immutable after construction; all const functions may be called from several threads.
class Vocabulary {
 public:
  /// A node's children stand together, after it. Node 0 is the root, whose descriptor is unused.
  struct Node {
    BinaryDescriptor descriptor;
    std::uint32_t first_child = 0;
    std::uint32_t child_count = 0;  ///< 0: the node is a word
    WordId word = 0;                ///< leaves only: number of the word, from 0
    float idf = 0;                  ///< leaves only: ln(documents / documents with the word)
  };

  Vocabulary() = default;
  /// Takes a tree as the trainer makes it. Throws std::runtime_error if it is not one.
  explicit Vocabulary(std::vector<Node> nodes);

  [[nodiscard]] std::size_t word_count() const { return word_count_; }
  [[nodiscard]] const std::vector<Node>& nodes() const { return nodes_; }
  [[nodiscard]] int depth() const { return depth_; }

  /// Word a descriptor falls to: the nearest child at each level, the first among equals.
  [[nodiscard]] WordId word(const BinaryDescriptor& descriptor) const {
    return nodes_[leaf(descriptor)].word;
  }
  /// tf-idf bag of an image's corners.
  [[nodiscard]] BagOfWords bag(std::span<const DescribedCorner> corners) const;

  /// Little-endian file: "TFVOC", version, counts, nodes, CRC-32 (docs/places.md). Both throw
  /// std::runtime_error naming the file and what is wrong; reading trusts nothing in the file.
  void save(const std::filesystem::path& file) const;
  [[nodiscard]] static Vocabulary load(const std::filesystem::path& file);
  /// The same from memory; `name` stands in messages.
  [[nodiscard]] static Vocabulary parse(std::span<const std::uint8_t> bytes, const std::string& name);

 private:
  [[nodiscard]] std::size_t leaf(const BinaryDescriptor& descriptor) const;

  std::vector<Node> nodes_;
  std::size_t word_count_ = 0;
  int depth_ = 0;
};

}  // namespace twofold
