#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace twofold {

/// Which of n unknowns are coupled with each other, a bit a pair. Small enough for windows (n^2 / 8 bytes),
/// and 64 unknowns are handled at once.
class CouplingPattern {
 public:
  CouplingPattern() = default;
  explicit CouplingPattern(int n)
      : n_(n), words_((n + 63) / 64), bits_(static_cast<std::size_t>(n) * words_, 0) {}

  [[nodiscard]] int size() const { return n_; }
  /// i != j
  void couple(int i, int j) {
    if (i > j) std::swap(i, j);
    row(i)[j / 64] |= bit(j);
  }
  /// Couples j with all after j that i < j is coupled with.
  void inherit(int j, int i) {
    for (int w = j / 64; w < words_; ++w) row(j)[w] |= row(i)[w];
    row(j)[j / 64] &= ~(bit(j) | (bit(j) - 1));
  }
  /// visit(j) for all j > i coupled with i, rising.
  template <class Visit>
  void for_each_after(int i, Visit&& visit) const {
    const std::uint64_t* words = bits_.data() + static_cast<std::size_t>(i) * words_;
    for (int w = i / 64; w < words_; ++w) {
      for (std::uint64_t word = words[w]; word != 0; word &= word - 1) visit(64 * w + std::countr_zero(word));
    }
  }
  friend bool operator==(const CouplingPattern&, const CouplingPattern&) = default;

 private:
  [[nodiscard]] static std::uint64_t bit(int j) { return std::uint64_t{1} << (j % 64); }
  [[nodiscard]] std::uint64_t* row(int i) { return bits_.data() + static_cast<std::size_t>(i) * words_; }

  int n_ = 0, words_ = 0;
  std::vector<std::uint64_t> bits_;
};

}  // namespace twofold
