#pragma once

#include "engine/result.hpp"
#include "twofold/slam.hpp"

namespace twofold {

/// Of what the engine leaves behind; SlamSummary::errors has the engine's own only.
[[nodiscard]] SlamSummary summarise(const RunResult& result);

}  // namespace twofold
