#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "engine/clock.hpp"
#include "engine/latency_histogram.hpp"
#include "engine/trace.hpp"

namespace twofold {

/// Number of a registered stage.
using StageId = std::size_t;

/// Durations of one thread's named stages, and, if asked for, when they happened.
///
/// Stages are registered before the thread starts. record is for that thread only, wait-free and without
/// allocation; histograms may be read any time (see LatencyHistogram).
class StageRecorder {
 public:
  /// trace: nullptr, or where spans go as well; both trace and track outlive the recorder.
  explicit StageRecorder(std::string thread_name, Trace* trace = nullptr,
                         std::size_t trace_capacity = 1U << 18);

  [[nodiscard]] StageId add_stage(std::string_view name);
  /// Number of a counter (a queue's depth, a snapshot's version); kept in the trace only.
  [[nodiscard]] TraceName add_counter(std::string_view name);

  void record(StageId stage, std::int64_t begin_ns, std::int64_t duration_ns) {
    stages_[stage].histogram.record(duration_ns);
    if (track_ != nullptr) track_->span(stages_[stage].trace_name, begin_ns, duration_ns);
  }
  void counter(TraceName name, std::int64_t value) {
    if (track_ != nullptr) track_->counter(name, steady_now_ns(), value);
  }

  [[nodiscard]] const std::string& thread_name() const { return thread_name_; }
  [[nodiscard]] const LatencyHistogram& histogram(StageId stage) const { return stages_[stage].histogram; }
  /// Stage name -> LatencyHistogram::to_json, in alphabetic order.
  [[nodiscard]] nlohmann::json to_json() const;

 private:
  struct Stage {
    std::string name;
    TraceName trace_name = 0;
    LatencyHistogram histogram;
  };
  std::string thread_name_;
  std::vector<Stage> stages_;
  Trace* trace_;
  TraceTrack* track_;
};

/// Times the scope it stands in.
class ScopedStage {
 public:
  ScopedStage(StageRecorder& recorder, StageId stage)
      : recorder_(recorder), stage_(stage), begin_ns_(steady_now_ns()) {}
  ~ScopedStage() { recorder_.record(stage_, begin_ns_, steady_now_ns() - begin_ns_); }
  ScopedStage(const ScopedStage&) = delete;
  ScopedStage& operator=(const ScopedStage&) = delete;

 private:
  StageRecorder& recorder_;
  const StageId stage_;
  const std::int64_t begin_ns_;
};

}  // namespace twofold
