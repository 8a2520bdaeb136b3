#include "apps/twofold/loop_latency.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

namespace twofold {
namespace {

constexpr std::int64_t kBeforeNs = 1'000'000'000;
constexpr std::int64_t kAfterNs = 4'000'000'000;
constexpr std::array kBounds_ms{0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 33};  // and beyond

std::array<std::uint64_t, kBounds_ms.size()> counts(const LatencyHistogram& histogram) {
  std::array<std::uint64_t, kBounds_ms.size()> in_row{};
  const nlohmann::json json = histogram.to_json();
  for (const auto& bucket : json["buckets"]) {
    const double middle_ms = 0.5e-3 * (bucket[0].get<double>() + bucket[1].get<double>());
    const auto above = std::upper_bound(kBounds_ms.begin(), kBounds_ms.end(), middle_ms);
    in_row[static_cast<std::size_t>(above - kBounds_ms.begin() - 1)] += bucket[2].get<std::uint64_t>();
  }
  return in_row;
}

std::string quantiles(const LatencyHistogram& histogram) {
  const auto ms = [&](double q) { return static_cast<double>(histogram.quantile_ns(q)) * 1e-6; };
  return fmt::format("p50 {:.2f}, p90 {:.2f}, p99 {:.2f}, max {:.2f} ms", ms(0.5), ms(0.9), ms(0.99),
                     static_cast<double>(histogram.max_ns()) * 1e-6);
}

}  // namespace

LoopLatency loop_latency(const RunResult& result) {
  LoopLatency latency;
  for (const FrameRecord& record : result.frames) {
    if (record.state == FrameState::kDropped) continue;
    const bool near = std::any_of(result.loops.begin(), result.loops.end(), [&](const ClosedLoop& loop) {
      return record.t_ns >= loop.t_ns - kBeforeNs && record.t_ns <= loop.t_ns + kAfterNs;
    });
    (near ? latency.near : latency.rest).record(record.latency_ns);
  }
  return latency;
}

std::string loop_latency_table(const LoopLatency& latency) {
  const auto near = counts(latency.near), rest = counts(latency.rest);
  const auto share = [](std::uint64_t part, std::uint64_t all) {
    return 100.0 * static_cast<double>(part) / static_cast<double>(std::max<std::uint64_t>(1, all));
  };
  std::string text = fmt::format("{:>10} {:>16} {:>16}\n", "latency", "5 s round loops", "elsewhere");
  for (std::size_t row = 0; row < kBounds_ms.size(); ++row) {
    const std::string range = row + 1 < kBounds_ms.size()
                                  ? fmt::format("{}-{} ms", kBounds_ms[row], kBounds_ms[row + 1])
                                  : fmt::format("> {} ms", kBounds_ms[row]);
    text += fmt::format("{:>10} {:>7} {:>6.2f} % {:>7} {:>6.2f} %\n", range, near[row],
                        share(near[row], latency.near.count()), rest[row],
                        share(rest[row], latency.rest.count()));
  }
  text += fmt::format("5 s round loops: {} frames, {}\n", latency.near.count(), quantiles(latency.near));
  text += fmt::format("elsewhere:       {} frames, {}\n", latency.rest.count(), quantiles(latency.rest));
  return text;
}

}  // namespace twofold
