#include "engine/latency_histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>
#include <vector>

namespace twofold {
namespace {

/// The definition: smallest record that at least ceil(q n) records do not exceed.
std::int64_t exact_quantile(const std::vector<std::int64_t>& sorted, double q) {
  const auto rank = static_cast<std::size_t>(std::ceil(q * static_cast<double>(sorted.size())));
  return sorted[std::max<std::size_t>(rank, 1) - 1];
}

TEST(LatencyBuckets, CoverAllDurationsWithoutGapAndWithinOnePercent) {
  const std::size_t last = latency_bucket(kLargestLatencyNs);
  EXPECT_EQ(latency_bucket_begin_ns(0), 0);
  for (std::size_t b = 0; b < last; ++b) {
    const std::int64_t begin = latency_bucket_begin_ns(b);
    const std::int64_t end = latency_bucket_begin_ns(b + 1);
    ASSERT_LT(begin, end);
    ASSERT_EQ(latency_bucket(begin), b);
    ASSERT_EQ(latency_bucket(end - 1), b);
    if (begin < 1000) continue;
    ASSERT_LE(static_cast<double>(end - begin), 0.01 * static_cast<double>(begin));
  }
  EXPECT_EQ(latency_bucket(kLargestLatencyNs * 10), last);
}

TEST(LatencyHistogram, QuantilesAgreeWithSortingWithinOnePercent) {
  std::mt19937_64 rng(3);
  std::lognormal_distribution<double> typical(std::log(3e6), 1.2);         // around 3 ms, long tail
  std::uniform_real_distribution<double> exponent(3.0, std::log10(6e10));  // 1 us to 60 s
  for (const bool wide : {false, true}) {
    LatencyHistogram histogram;
    std::vector<std::int64_t> all;
    for (int i = 0; i < 20'000; ++i) {
      const double ns = wide ? std::pow(10.0, exponent(rng)) : std::clamp(typical(rng), 1e3, 6e10);
      all.push_back(static_cast<std::int64_t>(ns));
      histogram.record(all.back());
    }
    std::sort(all.begin(), all.end());
    for (const double q : {0.0, 0.001, 0.1, 0.5, 0.9, 0.99, 0.999, 0.9999, 1.0}) {
      const auto exact = static_cast<double>(exact_quantile(all, q));
      EXPECT_NEAR(static_cast<double>(histogram.quantile_ns(q)), exact, 0.005 * exact) << "q = " << q;
    }
    EXPECT_EQ(histogram.count(), all.size());
    EXPECT_EQ(histogram.max_ns(), all.back());
    EXPECT_EQ(histogram.min_ns(), all.front());
    double sum = 0;
    for (const std::int64_t ns : all) sum += static_cast<double>(ns);
    EXPECT_NEAR(histogram.mean_ns(), sum / static_cast<double>(all.size()), 1e-6 * histogram.mean_ns());
  }
}

TEST(LatencyHistogram, KeepsOutliersAndNonsense) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.quantile_ns(0.5), 0);
  EXPECT_EQ(histogram.max_ns(), 0);
  EXPECT_EQ(histogram.min_ns(), 0);
  histogram.record(-5);
  histogram.record(100 * kLargestLatencyNs);
  EXPECT_EQ(histogram.count(), 2u);
  EXPECT_EQ(histogram.quantile_ns(0.5), 0 + histogram.quantile_ns(0.0));
  EXPECT_EQ(histogram.max_ns(), 100 * kLargestLatencyNs);
  EXPECT_EQ(histogram.quantile_ns(1.0), 100 * kLargestLatencyNs);
}

TEST(LatencyHistogram, JsonHoldsFiguresAndFilledBuckets) {
  LatencyHistogram histogram;
  for (int i = 0; i < 99; ++i) histogram.record(2'000'000);
  histogram.record(40'000'000);
  const nlohmann::json json = histogram.to_json();
  EXPECT_EQ(json.at("count"), 100);
  EXPECT_NEAR(json.at("p50_ms").get<double>(), 2.0, 0.02);
  EXPECT_NEAR(json.at("p99_ms").get<double>(), 2.0, 0.02);
  EXPECT_NEAR(json.at("p99_9_ms").get<double>(), 40.0, 0.4);
  EXPECT_DOUBLE_EQ(json.at("max_ms").get<double>(), 40.0);
  EXPECT_NEAR(json.at("mean_ms").get<double>(), 2.38, 1e-9);
  ASSERT_EQ(json.at("buckets").size(), 2u);
  const auto& bucket = json.at("buckets").at(0);
  EXPECT_LE(bucket.at(0).get<double>(), 2000.0);
  EXPECT_GT(bucket.at(1).get<double>(), 2000.0);
  EXPECT_EQ(bucket.at(2), 99);
}

TEST(LatencyHistogram, MayBeReadWhileItIsRecorded) {
  LatencyHistogram histogram;
  std::jthread writer([&] {
    for (int i = 0; i < 200'000; ++i) histogram.record(1000 + i);
  });
  std::uint64_t last = 0;
  while (last < 200'000) {
    const std::uint64_t count = histogram.count();
    ASSERT_GE(count, last);
    last = count;
    ASSERT_LE(histogram.quantile_ns(0.5), 210'000);
  }
}

}  // namespace
}  // namespace twofold
