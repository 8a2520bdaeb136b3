#pragma once

// Everything of the standard library and of the engine that a model needs is included before the model
// checker, whose header turns `new`, `delete` and the memory orders into macros. <relacy/relacy_std.hpp> is
// not used: it defines std::atomic, which libstdc++ does already.
#include <atomic>
#include <cstdint>
#include <cstring>
#include <iostream>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "engine/frame_pool.hpp"
#include "engine/snapshot_mailbox.hpp"
#include "engine/spsc_ring.hpp"
#include "graph/shared_array.hpp"
#include "slam/hand_over_slot.hpp"
#include "slam/latest_value.hpp"

// Model checker; its warnings are its own.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wall"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"
#include <relacy/relacy.hpp>
#pragma GCC diagnostic pop
#undef new
#undef delete
#undef malloc
#undef calloc
#undef realloc
#undef memory_order_relaxed
#undef memory_order_consume
#undef memory_order_acquire
#undef memory_order_release
#undef memory_order_acq_rel
#undef memory_order_seq_cst

namespace twofold {

/// Which memory order of which thread a run breaks on purpose. A thread number and a kind of access together
/// single out one end of each pair that the classes' comments name.
struct SeededFault {
  enum class Access { kNone, kLoad, kStore, kExchange, kReadModifyWrite };
  Access access = Access::kNone;
  int thread = -1;
};
inline SeededFault g_fault;  // set once by main, before any model runs

inline rl::memory_order model_order(std::memory_order order, SeededFault::Access access) {
  if (g_fault.access == access && static_cast<int>(rl::thread_index()) == g_fault.thread)
    return rl::mo_relaxed;
  switch (order) {
    case std::memory_order_relaxed:
      return rl::mo_relaxed;
    case std::memory_order_consume:
      return rl::mo_consume;
    case std::memory_order_acquire:
      return rl::mo_acquire;
    case std::memory_order_release:
      return rl::mo_release;
    case std::memory_order_acq_rel:
      return rl::mo_acq_rel;
    default:
      return rl::mo_seq_cst;
  }
}

/// std::atomic's face on the model checker's atomic.
template <class V>
class ModelAtomic {
  using Access = SeededFault::Access;
  // The model checker's record of events takes no pointers to const.
  using Stored = std::conditional_t<std::is_pointer_v<V>,
                                    std::add_pointer_t<std::remove_const_t<std::remove_pointer_t<V>>>, V>;

 public:
  ModelAtomic() : ModelAtomic(V{}) {}
  ModelAtomic(V value) { value_.store(unconst(value), rl::mo_relaxed, $); }
  V load(std::memory_order order) const { return value_.load(model_order(order, Access::kLoad), $); }
  void store(V value, std::memory_order order) { value_.store(value, model_order(order, Access::kStore), $); }
  V exchange(V value, std::memory_order order) {
    return value_.exchange(unconst(value), model_order(order, Access::kExchange), $);
  }
  V fetch_add(V value, std::memory_order order) {
    return value_.fetch_add(value, model_order(order, Access::kReadModifyWrite), $);
  }
  V fetch_sub(V value, std::memory_order order) {
    return value_.fetch_sub(value, model_order(order, Access::kReadModifyWrite), $);
  }

 private:
  static Stored unconst(V value) {
    if constexpr (std::is_pointer_v<V>)
      return const_cast<Stored>(value);
    else
      return value;
  }
  rl::atomic<Stored> value_;
};

struct ModelAtomics {
  template <class V>
  using Atomic = ModelAtomic<V>;
};

/// Runs the model over random interleavings and stale reads. Returns the process's exit code: 0 when it
/// holds.
template <class Model>
int check_model(unsigned iterations) {
  rl::test_params params;
  params.search_type = rl::random_scheduler_type;
  params.iteration_count = iterations;
  params.execution_depth_limit = 10'000;
  std::ostream nowhere(nullptr);  // the failing execution's history, thousands of lines; must not allocate
  params.output_stream = &nowhere;
  params.progress_stream = &nowhere;
  const bool holds = rl::simulate<Model>(params);
  std::cout << (holds ? "holds" : rl::test_result_str(params.test_result)) << " after "
            << params.stop_iteration << " executions\n";
  return holds ? 0 : 1;
}

/// Reads "ACCESS THREAD" (such as "store 0") from the command line into g_fault; nothing means no fault.
inline bool parse_fault(int argc, char** argv) {
  if (argc == 1) return true;
  if (argc != 3) return false;
  const std::string access = argv[1];
  g_fault.thread = std::stoi(argv[2]);
  using Access = SeededFault::Access;
  if (access == "load") g_fault.access = Access::kLoad;
  if (access == "store") g_fault.access = Access::kStore;
  if (access == "exchange") g_fault.access = Access::kExchange;
  if (access == "rmw") g_fault.access = Access::kReadModifyWrite;
  return g_fault.access != Access::kNone;
}

}  // namespace twofold
