#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace twofold {

/// Who agrees with whom, of n matches: an undirected graph, a row of bits for each of them.
class AgreementGraph {
 public:
  explicit AgreementGraph(std::size_t n) : n_(n), words_((n + 63) / 64), bits_(n * words_) {}

  void join(std::size_t a, std::size_t b) {
    bits_[a * words_ + b / 64] |= bit(b);
    bits_[b * words_ + a / 64] |= bit(a);
  }
  /// Bit b % 64 of word b / 64: whether a and b agree.
  [[nodiscard]] std::span<const std::uint64_t> row(std::size_t a) const {
    return {bits_.data() + a * words_, words_};
  }
  [[nodiscard]] bool agree(std::size_t a, std::size_t b) const { return (row(a)[b / 64] & bit(b)) != 0; }
  [[nodiscard]] static std::uint64_t bit(std::size_t b) { return std::uint64_t{1} << (b % 64); }

  /// Triples any two of which agree, members and triples in ascending order; where there are more than `most`
  /// (>= 1), every second, third, .. of them, so that at most so many are left. O(n^3 / 64).
  [[nodiscard]] std::vector<std::array<int, 3>> triples(std::size_t most) const;

 private:
  template <class Visit>
  void for_each_pair(const Visit& visit) const;

  std::size_t n_, words_;
  std::vector<std::uint64_t> bits_;
};

}  // namespace twofold
