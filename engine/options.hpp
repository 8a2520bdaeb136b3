#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "engine/pacing.hpp"
#include "loopclosure/loop_closer.hpp"
#include "mapping/mapper.hpp"
#include "tracking/options.hpp"

namespace twofold {

struct EngineOptions {
  TrackerOptions tracker;
  MapperOptions mapper;
  LoopCloserOptions loop_closer;
  /// Words that places are recognised by; null: no loop is closed by appearance, no lost camera finds itself.
  std::shared_ptr<const Vocabulary> vocabulary;

  /// One thread, one order: each frame is tracked against the map with every earlier keyframe optimised.
  bool deterministic = false;
  PacingOptions pacing{.speed = 0};  ///< of threaded runs

  std::size_t frame_slots = 8;     ///< frames decoded ahead, or waiting, at most
  std::size_t proposal_slots = 4;  ///< keyframe proposals under way between the threads, a power of two

  std::optional<int> tracker_cpu;  ///< pin the threads
  std::optional<int> mapper_cpu;
  std::optional<int> loop_closer_cpu;
  std::optional<int> fifo_priority;  ///< SCHED_FIFO for the tracker

  bool trace = false;  ///< keep spans and counters for RunResult::trace
};

}  // namespace twofold
