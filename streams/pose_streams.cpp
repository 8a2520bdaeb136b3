#include "streams/pose_streams.hpp"

#include <pthread.h>

#include <chrono>
#include <csignal>
#include <thread>

namespace twofold {
namespace {

constexpr auto kLastCall = std::chrono::milliseconds(500);

/// A pipe without a reader is an error of write, not the end of the process. The signal would go to the
/// thread that writes.
void block_sigpipe() {
  sigset_t pipe;
  sigemptyset(&pipe);
  sigaddset(&pipe, SIGPIPE);
  pthread_sigmask(SIG_BLOCK, &pipe, nullptr);
}

}  // namespace

PoseStreams::PoseStreams(std::vector<std::unique_ptr<PoseOutput>> outputs, PoseForm form)
    : outputs_(std::move(outputs)), form_(form) {
  writer_.emplace(WorkerOptions{.name = "pose writer", .time_slice = kPromptSlice},
                  [this](const std::stop_token&) { write_all(); });
}

void PoseStreams::write_all() {
  block_sigpipe();
  PoseOrEvent item;
  while (queue_.next(item) == QueueStatus::kItem) write(item);
  hand_over_rest();
}

void PoseStreams::write(const PoseOrEvent& item) {
  const std::string lines = std::holds_alternative<PoseEstimate>(item)
                                ? pose_line(std::get<PoseEstimate>(item), form_)
                                : event_line(std::get<MapEvent>(item), form_);
  const std::uint64_t missed = queue_.take_missed();
  for (const auto& output : outputs_) {
    if (missed > 0) output->miss(missed);
    if (!lines.empty()) output->offer(lines);
  }
}

void PoseStreams::hand_over_rest() {
  if (const std::uint64_t missed = queue_.take_missed(); missed > 0) {
    for (const auto& output : outputs_) output->miss(missed);
  }
  const auto deadline = std::chrono::steady_clock::now() + kLastCall;
  for (;;) {
    bool done = true;
    for (const auto& output : outputs_) done &= output->flush();
    if (done || std::chrono::steady_clock::now() >= deadline) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

void PoseStreams::finish() {
  if (!writer_) return;
  queue_.close();
  (void)writer_->join();
  writer_.reset();
}

std::vector<std::string> PoseStreams::problems() const {
  std::vector<std::string> problems;
  for (const auto& output : outputs_) {
    if (std::string problem = output->problem(); !problem.empty()) problems.push_back(std::move(problem));
  }
  return problems;
}

}  // namespace twofold
