#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "engine/pacing.hpp"
#include "mapping/mapper.hpp"
#include "tracking/options.hpp"

namespace twofold {

struct EngineOptions {
  TrackerOptions tracker;
  MapperOptions mapper;

  /// One thread, one order: each frame is tracked against the map with every earlier keyframe optimised.
  bool deterministic = false;
  PacingOptions pacing{.speed = 0};  ///< of threaded runs

  std::size_t frame_slots = 8;     ///< frames decoded ahead, or waiting, at most
  std::size_t proposal_slots = 8;  ///< keyframe proposals under way between the threads, a power of two

  std::optional<int> tracker_cpu;  ///< pin the threads
  std::optional<int> mapper_cpu;
  std::optional<int> loop_closer_cpu;
  std::optional<int> fifo_priority;  ///< SCHED_FIFO for the tracker

  bool trace = false;  ///< keep spans and counters for RunResult::trace
};

}  // namespace twofold
