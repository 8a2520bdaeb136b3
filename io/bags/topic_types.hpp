#pragma once

#include <string>

namespace twofold {

/// ROS 1's name of a type: without ROS 2's "/msg".
[[nodiscard]] inline std::string plain_type(std::string type) {
  if (const auto middle = type.find("/msg/"); middle != std::string::npos) type.erase(middle, 4);
  return type;
}

}  // namespace twofold
