#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace twofold {

enum class Health : std::uint8_t {
  kOk,
  kWarn,  ///< will cost frames or milliseconds now and then
  kBad    ///< what was asked for cannot work
};

/// One line of the doctor's report.
struct Finding {
  Health health = Health::kOk;
  std::string subject;  ///< "governor"
  std::string state;    ///< what was found
  std::string remedy;   ///< what to do about it; empty when ok
};

}  // namespace twofold
