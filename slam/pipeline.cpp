#include "slam/pipeline.hpp"

#include "engine/engine.hpp"

namespace twofold {
namespace {

class ThreadedPipeline final : public Pipeline {
 public:
  ThreadedPipeline(const Rig& rig, const EngineOptions& options) : run_(rig, options) { run_.start(); }

  [[nodiscard]] bool has_buffer() override {
    collect();
    return run_.has_buffer();
  }
  [[nodiscard]] bool has_room() override {
    collect();
    return run_.has_room();
  }
  void collect() override { run_.collect({}); }
  void push(Frame frame) override { run_.push(std::move(frame)); }
  void wait(std::chrono::steady_clock::time_point deadline) override { run_.wait(deadline); }
  [[nodiscard]] bool failed() override { return run_.failed(); }
  [[nodiscard]] std::vector<std::string> log_errors() const override { return run_.log_errors(); }
  [[nodiscard]] QueueLengths waiting() const override {
    return {static_cast<std::int64_t>(run_.frames_waiting()),
            static_cast<std::int64_t>(run_.keyframes_waiting()),
            static_cast<std::int64_t>(run_.places_waiting())};
  }
  [[nodiscard]] RunResult finish() override {
    run_.stop();
    run_.collect({});
    return run_.finish();
  }

 private:
  ThreadedRun run_;
};

class DeterministicPipeline final : public Pipeline {
 public:
  DeterministicPipeline(const Rig& rig, const EngineOptions& options) : run_(rig, options) {}

  [[nodiscard]] bool has_buffer() override { return true; }
  [[nodiscard]] bool has_room() override { return true; }
  void collect() override {}
  void push(Frame frame) override { (void)run_.step(frame); }
  void wait(std::chrono::steady_clock::time_point) override {}
  [[nodiscard]] bool failed() override { return false; }
  [[nodiscard]] std::vector<std::string> log_errors() const override { return run_.log_errors(); }
  [[nodiscard]] QueueLengths waiting() const override { return {0, 0, 0}; }
  [[nodiscard]] RunResult finish() override { return run_.finish(); }

 private:
  LockstepRun run_;
};

}  // namespace

std::unique_ptr<Pipeline> make_pipeline(const Rig& rig, const EngineOptions& options) {
  expect_valid(rig, options);
  if (options.deterministic) return std::make_unique<DeterministicPipeline>(rig, options);
  return std::make_unique<ThreadedPipeline>(rig, options);
}

}  // namespace twofold
