// Cost of the calls that the tracker makes into the hand-over and recording classes. "Take" has to stay below
// 100 ns.
#include <benchmark/benchmark.h>
#include <sched.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>

#include "engine/frame_pool.hpp"
#include "engine/latency_histogram.hpp"
#include "engine/logs/schedule_log.hpp"
#include "engine/parking.hpp"
#include "engine/snapshot_mailbox.hpp"
#include "engine/spsc_ring.hpp"
#include "engine/stage_timer.hpp"
#include "engine/worker.hpp"

namespace twofold {
namespace {

/// As cheap to copy as a snapshot of shared chunks: a few pointers.
struct Snapshot {
  std::uint64_t number = 0;
  std::shared_ptr<const int> a = nullptr;
  std::shared_ptr<const int> b = nullptr;
  std::shared_ptr<const int> c = nullptr;
  std::shared_ptr<const int> d = nullptr;
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
  std::uint64_t refused = 0;
  for (auto _ : state) {
    for (; !ring.try_push(1); ++refused) std::this_thread::yield();
  }
  state.SetItemsProcessed(state.iterations());
  state.counters["refused_share"] = static_cast<double>(refused) / static_cast<double>(state.iterations());
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

/// Taking a version that another thread has just put, the case the budget of 100 ns is about. Each take is
/// timed by itself, so that the time includes one reading of the clock; other_core_share tells how many
/// crossed cores.
void mailbox_take_new_from_other_thread(benchmark::State& state) {
  const auto part = std::make_shared<const int>(1);
  SnapshotPublisher<Snapshot> publisher(1, {.number = 1});
  std::atomic<std::uint64_t> wanted{1};
  std::atomic<std::uint64_t> published{1};
  std::atomic<int> writer_cpu{-1};
  const auto pin = [](int cpu) { return configure_this_thread({.name = "bench", .cpu = cpu}).empty(); };
  cpu_set_t before;
  sched_getaffinity(0, sizeof before, &before);
  std::jthread writer([&](const std::stop_token& stop) {
    (void)pin(1);
    for (std::uint64_t v = 2; !stop.stop_requested();) {
      if (wanted.load() < v) {
        std::this_thread::yield();
        continue;
      }
      publisher.publish({v, part, part, part, part});
      writer_cpu.store(sched_getcpu());
      published.store(v++);
    }
  });
  auto& box = publisher.mailbox(0);
  LatencyHistogram times;
  std::uint64_t crossed = 0;
  std::uint64_t version = 1;
  (void)pin(0);
  for (auto _ : state) {
    wanted.store(++version);
    while (published.load() < version) std::this_thread::yield();
    const std::int64_t begin_ns = steady_now_ns();
    benchmark::DoNotOptimize(box.latest().version());
    const std::int64_t ns = steady_now_ns() - begin_ns;
    times.record(ns);
    state.SetIterationTime(static_cast<double>(ns) * 1e-9);
    crossed += writer_cpu.load() != sched_getcpu();
  }
  sched_setaffinity(0, sizeof before, &before);
  state.counters["other_core_share"] = static_cast<double>(crossed) / static_cast<double>(state.iterations());
  state.counters["p50_ns"] = static_cast<double>(times.quantile_ns(0.5));
  state.counters["p99_ns"] = static_cast<double>(times.quantile_ns(0.99));
}
BENCHMARK(mailbox_take_new_from_other_thread)->UseManualTime()->Iterations(200'000);

void clock_reading(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(steady_now_ns());
}
BENCHMARK(clock_reading);

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
  ScheduleStream<TrackerStep> stream;
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
