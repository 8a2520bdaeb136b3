// A plugin for qemu's user mode that counts the instructions a program executes, in all and by function: qemu
// knows no cycles, but what the compiler made of a loop it can tell. Built and used by scripts/arm64 count;
// QEMU's plugin interface, version 1, is declared here as far as it is used, as Debian has no package of its
// header.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

extern "C" {
struct qemu_plugin_tb;
struct qemu_plugin_insn;
struct qemu_info_t;
using qemu_plugin_id_t = std::uint64_t;
enum qemu_plugin_op { kAddU64 };

std::size_t qemu_plugin_tb_n_insns(const qemu_plugin_tb* tb);
qemu_plugin_insn* qemu_plugin_tb_get_insn(const qemu_plugin_tb* tb, std::size_t index);
const char* qemu_plugin_insn_symbol(const qemu_plugin_insn* insn);
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id,
                                           void (*translated)(qemu_plugin_id_t, qemu_plugin_tb*));
void qemu_plugin_register_vcpu_tb_exec_inline(qemu_plugin_tb* tb, qemu_plugin_op op, void* counter,
                                              std::uint64_t value);
void qemu_plugin_register_atexit_cb(qemu_plugin_id_t id, void (*ended)(qemu_plugin_id_t, void*), void* data);
}

namespace {

/// Counters by name of function; their addresses stay.
std::map<std::string, std::uint64_t>& counters() {
  static std::map<std::string, std::uint64_t> all;
  return all;
}

/// A block of instructions has been translated, and adds their number to its function's from now on.
void count_block(qemu_plugin_id_t, qemu_plugin_tb* tb) {
  const char* symbol = qemu_plugin_insn_symbol(qemu_plugin_tb_get_insn(tb, 0));
  std::uint64_t& counter = counters()[symbol == nullptr ? "(no symbol)" : symbol];
  qemu_plugin_register_vcpu_tb_exec_inline(tb, kAddU64, &counter, qemu_plugin_tb_n_insns(tb));
}

void report(qemu_plugin_id_t, void*) {
  std::vector<std::pair<std::uint64_t, std::string>> sorted;
  std::uint64_t total = 0;
  for (const auto& [name, count] : counters()) {
    total += count;
    sorted.emplace_back(count, name);
  }
  std::sort(sorted.rbegin(), sorted.rend());
  constexpr std::size_t kMost = 60;
  std::fprintf(stderr, "%12.3f million instructions\n", static_cast<double>(total) * 1e-6);
  for (std::size_t i = 0; i < std::min(kMost, sorted.size()); ++i)
    std::fprintf(stderr, "%12.3f %s\n", static_cast<double>(sorted[i].first) * 1e-6,
                 sorted[i].second.c_str());
}

}  // namespace

extern "C" {
__attribute__((visibility("default"))) extern const int qemu_plugin_version;
const int qemu_plugin_version = 1;

__attribute__((visibility("default"))) int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t*, int,
                                                               char**) {
  qemu_plugin_register_vcpu_tb_trans_cb(id, count_block);
  qemu_plugin_register_atexit_cb(id, report, nullptr);
  return 0;
}
}
