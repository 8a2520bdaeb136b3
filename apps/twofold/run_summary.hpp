#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/twofold/map_parts.hpp"
#include "engine/options.hpp"
#include "engine/result.hpp"

namespace twofold {

/// summary.json: counts, cost, loops, corrections of the pose, and of each lost or late frame the cause;
/// `errors` is left to the caller.
[[nodiscard]] nlohmann::ordered_json summary_json(const std::string& source_text,
                                                  const EngineOptions& options, const RunResult& result,
                                                  const std::vector<MapPart>& parts);

/// timing.json: each thread's stages, the latency round loops and elsewhere, frames on the effort levels.
[[nodiscard]] nlohmann::ordered_json timing_json(const RunResult& result);

}  // namespace twofold
