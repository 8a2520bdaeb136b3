#include "engine/worker.hpp"

#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "engine/clock.hpp"
#include "engine/health.hpp"
#include "engine/parking.hpp"
#include "fixtures/option_rules.hpp"

namespace twofold {
namespace {

TEST(Worker, RunsStopsAndJoins) {
  Parking parking;
  Worker worker({.name = "test"},
                [&](const std::stop_token& stop) { (void)parking.wait(stop, [] { return false; }); });
  EXPECT_FALSE(worker.finished());
  worker.request_stop();
  EXPECT_TRUE(worker.join());
  EXPECT_TRUE(worker.finished());
  EXPECT_TRUE(worker.notes().empty());
}

TEST(Worker, DestructionStopsASleepingBody) {
  Parking parking;
  std::atomic<bool> ended{false};
  {
    const Worker worker({.name = "test"}, [&](const std::stop_token& stop) {
      (void)parking.wait(stop, [] { return false; });
      ended = true;
    });
  }
  EXPECT_TRUE(ended);
}

TEST(Worker, AnExceptionBecomesAResult) {
  Worker worker({.name = "mapper"},
                [](const std::stop_token&) { throw std::runtime_error("no such window"); });
  const auto result = worker.join();
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error(), "mapper: no such window");
  Worker odd({.name = "odd"}, [](const std::stop_token&) { throw 7; });
  EXPECT_NE(odd.join().error().find("odd: "), std::string::npos);
  EXPECT_FALSE(odd.join());  // the same again
}

TEST(Worker, NamesItsThread) {
  std::array<char, 32> name{};
  Worker worker({.name = "a name longer than fifteen"}, [&](const std::stop_token&) {
    pthread_getname_np(pthread_self(), name.data(), name.size());
  });
  EXPECT_TRUE(worker.join());
  EXPECT_STREQ(name.data(), "a name longer t");
}

TEST(Worker, RefusedWishesAreToldAndTheThreadRunsOn) {
  std::atomic<bool> ran{false};
  Worker worker({.name = "tracker", .cpu = CPU_SETSIZE - 1}, [&](const std::stop_token&) { ran = true; });
  ASSERT_EQ(worker.notes().size(), 1u);
  EXPECT_NE(worker.notes()[0].find("tracker: running on CPU"), std::string::npos) << worker.notes()[0];
  EXPECT_TRUE(worker.join());
  EXPECT_TRUE(ran);
}

/// A priority that there is may be granted to whoever runs the tests.
TEST(Worker, RefusedPrioritiesAreTold) {
  std::vector<std::string> notes;
  std::thread([&] { notes = configure_this_thread({.name = "tracker", .fifo_priority = 1000}); }).join();
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("tracker: SCHED_FIFO priority 1000"), std::string::npos) << notes[0];
}

TEST(WorkerOptions, SayWhyTheyAreInvalid) {
  using std::chrono::microseconds;
  testing::expect_rules<WorkerOptions>(
      {{"cpu", [](auto& o) { o.cpu = -1; }},
       {"fifo_priority", [](auto& o) { o.fifo_priority = 100; }},
       {"time_slice", [](auto& o) { o.time_slice = microseconds(99); }},
       {"time_slice", [](auto& o) { o.time_slice = microseconds(100'001); }}});
  EXPECT_EQ((WorkerOptions{.cpu = 0, .fifo_priority = 99, .time_slice = kPatientSlice}).invalid_reason(), "");
}

TEST(Worker, PinsToACpuItMayUse) {
  cpu_set_t allowed;
  ASSERT_EQ(sched_getaffinity(0, sizeof allowed, &allowed), 0);
  int cpu = 0;
  while (!CPU_ISSET(cpu, &allowed)) ++cpu;
  int used = -1;
  Worker worker({.name = "pinned", .cpu = cpu}, [&](const std::stop_token&) { used = sched_getcpu(); });
  EXPECT_TRUE(worker.join());
  EXPECT_TRUE(worker.notes().empty());
  EXPECT_EQ(used, cpu);
}

/// What the kernel says of the calling thread: 48 bytes, the slice in ns at 24 (sched_setattr(2)).
std::optional<std::uint64_t> slice_ns() {
  std::array<std::uint64_t, 6> attributes{};
  if (syscall(SYS_sched_getattr, 0, attributes.data(), sizeof attributes, 0) != 0) return std::nullopt;
  return attributes[3];
}

TEST(Worker, TakesItsTimeSlice) {
  const std::optional<std::uint64_t> usual = slice_ns();
  if (!usual || *usual == 0) GTEST_SKIP() << "this kernel has one slice for all threads (before Linux 6.12)";
  std::optional<std::uint64_t> prompt;
  std::optional<std::uint64_t> patient;
  int nice = -1;
  EXPECT_TRUE(Worker({.name = "prompt", .time_slice = kPromptSlice}, [&](const std::stop_token&) {
                prompt = slice_ns();
              }).join());
  EXPECT_TRUE(Worker({.name = "patient", .time_slice = kPatientSlice}, [&](const std::stop_token&) {
                patient = slice_ns();
                yield_to_other_threads();
                nice = getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()));
              }).join());
  EXPECT_EQ(prompt, 500'000u);
  EXPECT_EQ(patient, 20'000'000u);
  EXPECT_EQ(nice, 10);
  EXPECT_EQ(slice_ns(), usual);  // of its own thread only
}

TEST(Health, CpuTimeAndMemoryGrowWithUse) {
  const ProcessUsage before = process_usage();
  EXPECT_GT(before.rss_bytes, 0);
  EXPECT_GE(before.peak_rss_bytes, before.rss_bytes);
  volatile double sink = 0;
  while (process_usage().cpu_seconds < before.cpu_seconds + 0.02) sink = sink + 1;
  constexpr std::size_t kBytes = std::size_t{64} << 20;
  std::vector<char> block(kBytes, 1);
  const ProcessUsage after = process_usage();
  EXPECT_GE(after.cpu_seconds - before.cpu_seconds, 0.02);
  EXPECT_LT(after.cpu_seconds - before.cpu_seconds, 5.0);
  EXPECT_GT(after.rss_bytes, before.rss_bytes + static_cast<std::int64_t>(kBytes) / 2);
  EXPECT_EQ(block[kBytes / 2], 1);
}

}  // namespace
}  // namespace twofold
