#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

namespace twofold {

/// The middle one by size, of an even number the upper of the two; 0 of none. Reorders the values; allocates
/// nothing.
template <class T>
[[nodiscard]] T median(std::span<T> values) {
  if (values.empty()) return T{0};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Which value counts where a share of the others falls between two.
enum class QuantileRank : std::uint8_t { kLower, kNearest };

/// The value that this share of the others lies below; 0 of none. Reorders the values; allocates nothing.
/// @param share  in [0, 1]
[[nodiscard]] inline double quantile(std::span<double> values, double share, QuantileRank rank) {
  if (values.empty()) return 0;
  const double position = share * static_cast<double>(values.size() - 1);
  const auto at = static_cast<std::ptrdiff_t>(rank == QuantileRank::kNearest ? position + 0.5 : position);
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

}  // namespace twofold
