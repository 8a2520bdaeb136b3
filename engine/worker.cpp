#include "engine/worker.hpp"

#include <linux/capability.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>

#include "base/check.hpp"
#include "base/option_check.hpp"
#include "engine/thrown.hpp"

namespace twofold {
namespace {

constexpr int kNice = 10;  // a tenth of the share of a thread that does not yield

/// The kernel's struct sched_attr in its first form, which every kernel takes.
struct SchedulingAttributes {
  std::uint32_t size = sizeof(SchedulingAttributes);
  std::uint32_t policy = 0;
  std::uint64_t flags = 0;
  std::int32_t nice = 0;
  std::uint32_t priority = 0;
  std::uint64_t runtime_ns = 0;  // of an ordinary thread: its slice
  std::uint64_t deadline_ns = 0;
  std::uint64_t period_ns = 0;
};
static_assert(sizeof(SchedulingAttributes) == 48);

/// A wish: kernels that know no slices leave it out, and a thread under SCHED_FIFO has none.
void take_time_slice(std::chrono::nanoseconds slice) {
  SchedulingAttributes attributes;
  if (syscall(SYS_sched_getattr, 0, &attributes, sizeof attributes, 0) != 0) return;
  if (attributes.policy != SCHED_OTHER) return;
  attributes.runtime_ns = static_cast<std::uint64_t>(slice.count());
  (void)syscall(SYS_sched_setattr, 0, &attributes, 0);
}

}  // namespace

std::string WorkerOptions::invalid_reason() const {
  OptionCheck check;
  if (cpu) check.at_least("cpu", *cpu, 0);
  if (fifo_priority) check.within("fifo_priority", *fifo_priority, 1, 99);
  if (time_slice) check.within("time_slice", static_cast<double>(time_slice->count()), 100, 100'000);
  return check.reason();
}

std::vector<std::string> configure_this_thread(const WorkerOptions& options) {
  std::vector<std::string> notes;
  const auto refuse = [&](const std::string& what, int error, const char* advice) {
    notes.push_back(options.name + ": " + what + " was refused (" + std::strerror(error) + "); " + advice);
  };
  pthread_setname_np(pthread_self(), options.name.substr(0, 15).c_str());
  if (options.cpu) {
    const std::string what = "running on CPU " + std::to_string(*options.cpu) + " only";
    cpu_set_t set;
    CPU_ZERO(&set);
    if (*options.cpu >= 0 && *options.cpu < CPU_SETSIZE) CPU_SET(*options.cpu, &set);
    if (const int error = pthread_setaffinity_np(pthread_self(), sizeof set, &set)) {
      refuse(what, error, "name a CPU that `taskset -cp $$` lists");
    }
  }
  if (options.time_slice) take_time_slice(*options.time_slice);
  if (options.fifo_priority) {
    const std::string what = "SCHED_FIFO priority " + std::to_string(*options.fifo_priority);
    sched_param parameters{};
    parameters.sched_priority = *options.fifo_priority;
    if (const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters)) {
      refuse(what, error, "priorities are 1 to 99 and need CAP_SYS_NICE or a limit raised by `ulimit -r`");
    }
  }
  return notes;
}

void yield_to_other_threads() {
  (void)setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);  // never refused
}

namespace {

bool may_lock_without_limit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY) return true;
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  __user_cap_data_struct data[_LINUX_CAPABILITY_U32S_3] = {};
  if (syscall(SYS_capget, &header, data) != 0) return false;
  return (data[0].effective & (1U << CAP_IPC_LOCK)) != 0;
}

}  // namespace

tl::expected<void, std::string> lock_memory() {
  // Under a limit the lock may succeed now and make every allocation beyond it fail later.
  if (!may_lock_without_limit()) {
    return tl::make_unexpected(
        std::string("memory is not locked: it needs CAP_IPC_LOCK or `ulimit -l unlimited`"));
  }
  if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return {};
  return tl::make_unexpected(std::string("locking memory was refused (") + std::strerror(errno) +
                             "); it needs CAP_IPC_LOCK or a limit raised by `ulimit -l`");
}

Worker::Worker(WorkerOptions options, std::function<void(std::stop_token)> body)
    : options_(std::move(options)) {
  TWOFOLD_CHECK(options_.invalid_reason().empty(), "worker options");
  thread_ = std::jthread([this, body = std::move(body)](const std::stop_token& stop) { run(stop, body); });
  started_.wait(false, std::memory_order_acquire);
}

Worker::~Worker() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void Worker::run(const std::stop_token& stop, const std::function<void(std::stop_token)>& body) {
  notes_ = configure_this_thread(options_);
  started_.store(true, std::memory_order_release);
  started_.notify_one();
  try {
    body(stop);
  } catch (...) {
    error_ = options_.name + ": " + what_was_thrown();
  }
  finished_.store(true, std::memory_order_release);
}

tl::expected<void, std::string> Worker::join() {
  if (thread_.joinable()) thread_.join();
  if (error_) return tl::make_unexpected(*error_);
  return {};
}

}  // namespace twofold
