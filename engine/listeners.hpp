#pragma once

#include <functional>
#include <utility>

namespace twofold {

/// Calls both, in this order; the first may be empty. For those who add theirs to EngineOptions.
template <class... Arguments>
[[nodiscard]] std::function<void(Arguments...)> both(std::function<void(Arguments...)> first,
                                                     std::function<void(Arguments...)> second) {
  if (!first) return second;
  return [first = std::move(first), second = std::move(second)](Arguments... arguments) {
    first(arguments...);
    second(arguments...);
  };
}

}  // namespace twofold
