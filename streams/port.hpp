#pragma once

#include <algorithm>
#include <cstdlib>
#include <string>

namespace twofold {

/// Libraries take port 70000 for 4464.
[[nodiscard]] inline bool is_beyond_ports(const std::string& port) {
  constexpr unsigned long kLargestPort = 65535;
  return std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; }) &&
         std::strtoul(port.c_str(), nullptr, 10) > kLargestPort;
}

}  // namespace twofold
