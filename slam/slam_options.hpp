#pragma once

#include "engine/logs/schedule_log.hpp"
#include "engine/options.hpp"
#include "twofold/slam.hpp"

namespace twofold {

/// Reads the files that the options name. Throws std::invalid_argument naming an option that makes no sense,
/// and std::runtime_error naming a file that cannot be used.
[[nodiscard]] EngineOptions engine_options(const SlamOptions& options);
/// Of RunMode::kReplay. Throws std::runtime_error naming the file.
[[nodiscard]] Schedule schedule_to_replay(const SlamOptions& options);

}  // namespace twofold
