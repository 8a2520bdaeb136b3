#pragma once

#include <cmath>
#include <cstdint>

namespace twofold::synthetic {

/// Finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014): every input bit reaches every output bit.
[[nodiscard]] inline std::uint64_t mix64(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// One random word for each (seed, stream, counter): no state, so the order of evaluation does not matter.
[[nodiscard]] inline std::uint64_t counter_hash(std::uint64_t seed, std::uint64_t stream,
                                                std::uint64_t counter) {
  return mix64(mix64(mix64(seed) ^ stream) ^ counter);
}

/// In [0, 1).
[[nodiscard]] inline double unit_interval(std::uint64_t word) {
  return static_cast<double>(word >> 11) * 0x1.0p-53;
}

/// Sequential generator for laying out scenes. Its numbers are the same with every standard library.
/// At most one is drawn among the arguments of a call: compilers evaluate these in any order.
class Random {
 public:
  explicit Random(std::uint64_t seed) : seed_(mix64(seed)) {}
  [[nodiscard]] std::uint64_t word() { return mix64(seed_ ^ mix64(++counter_)); }
  [[nodiscard]] double uniform(double low, double high) { return low + (high - low) * unit_interval(word()); }
  /// In [0, n); n > 0.
  [[nodiscard]] int below(int n) { return static_cast<int>(unit_interval(word()) * n); }
  [[nodiscard]] bool chance(double probability) { return unit_interval(word()) < probability; }

 private:
  std::uint64_t seed_;
  std::uint64_t counter_ = 0;
};

}  // namespace twofold::synthetic
