#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "loopclosure/vocabulary.hpp"

namespace twofold {

struct VocabularyTrainerOptions {
  int branching = 10;      ///< children of a node, >= 2
  int levels = 4;          ///< 10^4 words with the default branching (thesis 6.4.2), in [1, 6]
  int iterations = 12;     ///< of k-medians at each node, >= 1
  std::uint32_t seed = 1;  ///< same descriptors and seed, same tree

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Hierarchical k-medians: at each node the descriptors are parted around `branching` medians (majority of
/// each bit), started by k-means++ and refined until nothing moves. Words that would be empty do not exist.
///
/// @param images  descriptors of each training image; inverse document frequencies are counted over them
/// Throws std::runtime_error when there are fewer than two different descriptors.
[[nodiscard]] Vocabulary train_vocabulary(const std::vector<std::vector<BinaryDescriptor>>& images,
                                          const VocabularyTrainerOptions& options);

}  // namespace twofold
