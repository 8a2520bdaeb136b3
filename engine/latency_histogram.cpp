#include "engine/latency_histogram.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace twofold {

LatencyHistogram::LatencyHistogram() : state_(std::make_unique<State>()) {}

std::uint64_t LatencyHistogram::count() const {
  std::uint64_t total = 0;
  for (const auto& bucket : state_->buckets) total += bucket.load(std::memory_order_relaxed);
  return total;
}

double LatencyHistogram::mean_ns() const {
  const std::uint64_t n = count();
  return n == 0
             ? 0.0
             : static_cast<double>(state_->sum_ns.load(std::memory_order_relaxed)) / static_cast<double>(n);
}

std::int64_t LatencyHistogram::max_ns() const {
  return state_->max_ns.load(std::memory_order_relaxed);
}

std::int64_t LatencyHistogram::min_ns() const {
  const std::int64_t min = state_->min_ns.load(std::memory_order_relaxed);
  return min == std::numeric_limits<std::int64_t>::max() ? 0 : min;
}

std::int64_t LatencyHistogram::quantile_ns(double q) const {
  const auto wanted =
      static_cast<std::uint64_t>(std::ceil(std::clamp(q, 0.0, 1.0) * static_cast<double>(count())));
  const std::uint64_t rank = std::max<std::uint64_t>(wanted, 1);
  std::uint64_t seen = 0;
  for (std::size_t b = 0; b < kBuckets; ++b) {
    seen += state_->buckets[b].load(std::memory_order_relaxed);
    if (seen < rank) continue;
    // The last bucket is open above; everywhere else the ends are known better than the middle.
    if (b + 1 == kBuckets) return max_ns();
    return std::clamp((latency_bucket_begin_ns(b) + latency_bucket_begin_ns(b + 1)) / 2, min_ns(),
                      std::max(min_ns(), max_ns()));
  }
  return 0;
}

nlohmann::json LatencyHistogram::to_json() const {
  const auto ms = [](double ns) { return ns * 1e-6; };
  nlohmann::json buckets = nlohmann::json::array();
  for (std::size_t b = 0; b < kBuckets; ++b) {
    const std::uint64_t n = state_->buckets[b].load(std::memory_order_relaxed);
    if (n == 0) continue;
    buckets.push_back({static_cast<double>(latency_bucket_begin_ns(b)) * 1e-3,
                       static_cast<double>(latency_bucket_begin_ns(b + 1)) * 1e-3, n});
  }
  const auto quantile = [&](double q) { return ms(static_cast<double>(quantile_ns(q))); };
  return {{"count", count()},
          {"mean_ms", ms(mean_ns())},
          {"min_ms", ms(static_cast<double>(min_ns()))},
          {"p50_ms", quantile(0.5)},
          {"p90_ms", quantile(0.9)},
          {"p99_ms", quantile(0.99)},
          {"p99_9_ms", quantile(0.999)},
          {"max_ms", ms(static_cast<double>(max_ns()))},
          {"buckets", std::move(buckets)}};
}

}  // namespace twofold
