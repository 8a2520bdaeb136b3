// Cost of the calls that the tracker makes into the hand-over and recording classes. "Take" has to stay below
// 100 ns.
#include <benchmark/benchmark.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>

#include "engine/frame_pool.hpp"
#include "engine/latency_histogram.hpp"
#include "engine/parking.hpp"
#include "engine/schedule_log.hpp"
#include "engine/snapshot_mailbox.hpp"
#include "engine/spsc_ring.hpp"
#include "engine/stage_timer.hpp"

namespace twofold {
namespace {

/// As cheap to copy as a snapshot of shared chunks: a few pointers.
struct Snapshot {
  std::uint64_t number = 0;
  std::shared_ptr<const int> a, b, c, d;
  std::uint64_t version() const { return number; }
};

void ring_push_and_pop(benchmark::State& state) {
  SpscRing<std::uint64_t> ring(64);
  std::uint64_t out = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(ring.try_push(out + 1));
    benchmark::DoNotOptimize(ring.try_pop(out));
  }
}
BENCHMARK(ring_push_and_pop);

void ring_across_threads(benchmark::State& state) {
  SpscRing<std::uint64_t> ring(1024);
  std::jthread consumer([&](const std::stop_token& stop) {
    std::uint64_t out = 0;
    while (!stop.stop_requested()) {
      if (!ring.try_pop(out)) std::this_thread::yield();
    }
  });
  for (auto _ : state) {
    while (!ring.try_push(1)) std::this_thread::yield();
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(ring_across_threads)->UseRealTime();

void mailbox_take_nothing_new(benchmark::State& state) {
  SnapshotPublisher<Snapshot> publisher(2, {.number = 1});
  auto& box = publisher.mailbox(0);
  for (auto _ : state) benchmark::DoNotOptimize(&box.latest());
}
BENCHMARK(mailbox_take_nothing_new);

void mailbox_publish_and_take(benchmark::State& state) {
  const auto part = std::make_shared<const int>(1);
  SnapshotPublisher<Snapshot> publisher(2, {.number = 1});
  auto& box = publisher.mailbox(0);
  std::uint64_t version = 1;
  for (auto _ : state) {
    publisher.publish({++version, part, part, part, part});
    benchmark::DoNotOptimize(&box.latest());
  }
}
BENCHMARK(mailbox_publish_and_take);

/// The reader's side while another core publishes as fast as it can: far more contention than any run has.
void mailbox_take_while_publishing(benchmark::State& state) {
  SnapshotPublisher<Snapshot> publisher(1, {.number = 1});
  std::jthread writer([&](const std::stop_token& stop) {
    const auto part = std::make_shared<const int>(1);
    for (std::uint64_t v = 2; !stop.stop_requested(); ++v) publisher.publish({v, part, part, part, part});
  });
  auto& box = publisher.mailbox(0);
  for (auto _ : state) benchmark::DoNotOptimize(box.latest().version());
}
BENCHMARK(mailbox_take_while_publishing);

void mailbox_publish(benchmark::State& state) {
  const auto part = std::make_shared<const int>(1);
  SnapshotPublisher<Snapshot> publisher(2, {.number = 1});
  std::uint64_t version = 1;
  for (auto _ : state) publisher.publish({++version, part, part, part, part});
}
BENCHMARK(mailbox_publish);

void parking_wake_nobody(benchmark::State& state) {
  Parking parking;
  for (auto _ : state) parking.wake();
}
BENCHMARK(parking_wake_nobody);

void pool_acquire_and_drop(benchmark::State& state) {
  FramePool<int> pool(16);
  for (auto _ : state) benchmark::DoNotOptimize(pool.try_acquire());
}
BENCHMARK(pool_acquire_and_drop);

void histogram_record(benchmark::State& state) {
  LatencyHistogram histogram;
  std::int64_t ns = 1;
  for (auto _ : state) {
    ns = (ns * 1103515245 + 12345) & 0xFFFFFFF;  // up to 268 ms, all over the buckets
    histogram.record(ns);
  }
}
BENCHMARK(histogram_record);

void scoped_stage_with_trace(benchmark::State& state) {
  Trace trace;
  StageRecorder recorder("bench", &trace);
  const StageId stage = recorder.add_stage("stage");
  for (auto _ : state) const ScopedStage timer(recorder, stage);
}
BENCHMARK(scoped_stage_with_trace);

void schedule_append(benchmark::State& state) {
  ScheduleStream<TrackerStep> stream(std::size_t{64} << 20);
  TrackerStep step;
  for (auto _ : state) {
    ++step.frame;
    step.version += step.frame % 8 == 0;
    stream.append(step);
  }
}
BENCHMARK(schedule_append)->Iterations(10'000'000);

}  // namespace
}  // namespace twofold
