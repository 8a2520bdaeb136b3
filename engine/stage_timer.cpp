#include "engine/stage_timer.hpp"

#include <nlohmann/json.hpp>
#include <utility>

namespace twofold {

StageRecorder::StageRecorder(std::string thread_name, Trace* trace, std::size_t trace_capacity)
    : thread_name_(std::move(thread_name)),
      trace_(trace),
      track_(trace == nullptr ? nullptr : &trace->add_track(thread_name_, trace_capacity)) {}

StageId StageRecorder::add_stage(std::string_view name) {
  stages_.push_back({std::string(name), trace_ == nullptr ? TraceName{0} : trace_->name(name), {}});
  return stages_.size() - 1;
}

TraceName StageRecorder::add_counter(std::string_view name) {
  return trace_ == nullptr ? TraceName{0} : trace_->name(name);
}

nlohmann::json StageRecorder::to_json() const {
  nlohmann::json stages = nlohmann::json::object();
  for (const Stage& stage : stages_) stages[stage.name] = stage.histogram.to_json();
  return stages;
}

}  // namespace twofold
