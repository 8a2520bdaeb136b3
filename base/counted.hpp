#pragma once

#include <string>

namespace twofold {

/// "1 frame", "2 frames", "0 frames": for nouns whose plural has an s.
template <class Integer>
[[nodiscard]] std::string counted(Integer count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

}  // namespace twofold
