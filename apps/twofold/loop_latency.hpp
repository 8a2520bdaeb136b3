#pragma once

#include <string>

#include "engine/latency_histogram.hpp"
#include "engine/result.hpp"

namespace twofold {

/// Latency of frames, from their exposure to their pose, near closed loops and elsewhere:
/// what a closure costs the tracker.
struct LoopLatency {
  LatencyHistogram near;  ///< from 1 s before to 4 s after a frame whose place was recognised
  LatencyHistogram rest;
};

/// Over all frames that were looked at.
[[nodiscard]] LoopLatency loop_latency(const RunResult& result);

/// Both as one table of counts and shares, a row a range of milliseconds, then the quantiles.
[[nodiscard]] std::string loop_latency_table(const LoopLatency& latency);

}  // namespace twofold
