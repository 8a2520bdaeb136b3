#pragma once

#include <algorithm>
#include <cstddef>
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

}  // namespace twofold
