#include "geometry/consistent_matches.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "base/option_check.hpp"
#include "geometry/agreement_graph.hpp"

namespace twofold {
namespace {

int common(std::span<const std::uint64_t> a, std::span<const std::uint64_t> b) {
  int count = 0;
  for (std::size_t w = 0; w < a.size(); ++w) count += std::popcount(a[w] & b[w]);
  return count;
}

/// Variance of |a - b| by first-order propagation.
double distance_variance(const Vector3& difference, double distance, const Matrix3& covariance) {
  if (!(distance > 0)) return covariance.trace();
  return difference.dot(covariance * difference) / (distance * distance);
}

bool agree(const PointMatch3d& a, const PointMatch3d& b, const ConsistencyOptions& options) {
  const Vector3 v_0 = a.x_0 - b.x_0, v_1 = a.x_1 - b.x_1;
  const double d_0 = v_0.norm(), d_1 = v_1.norm();
  const double variance = distance_variance(v_0, d_0, a.covariance_0 + b.covariance_0) +
                          distance_variance(v_1, d_1, a.covariance_1 + b.covariance_1);
  return std::abs(d_0 - d_1) <= options.threshold + options.sigmas * std::sqrt(variance);
}

}  // namespace

std::string ConsistencyOptions::invalid_reason() const {
  return OptionCheck().at_least("threshold", threshold, 0).at_least("sigmas", sigmas, 0).reason();
}

std::vector<int> consistent_matches(std::span<const PointMatch3d> matches,
                                    const ConsistencyOptions& options) {
  const std::size_t n = matches.size();
  AgreementGraph graph(n);
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = a + 1; b < n; ++b) {
      if (agree(matches[a], matches[b], options)) graph.join(a, b);
    }
  }
  std::vector<std::uint64_t> candidates((n + 63) / 64, ~std::uint64_t{0});
  std::vector<bool> open(n, true);
  std::vector<int> clique;
  for (;;) {
    int best = -1, most = -1;
    for (std::size_t i = 0; i < n; ++i) {
      if (!open[i]) continue;
      const int kept = common(candidates, graph.row(i));
      if (kept <= most) continue;
      best = static_cast<int>(i);
      most = kept;
    }
    if (best < 0) break;
    clique.push_back(best);
    const auto row = graph.row(static_cast<std::size_t>(best));
    for (std::size_t w = 0; w < candidates.size(); ++w) candidates[w] &= row[w];
    for (std::size_t i = 0; i < n; ++i) open[i] = (candidates[i / 64] & AgreementGraph::bit(i)) != 0;
  }
  std::sort(clique.begin(), clique.end());
  return clique;
}

}  // namespace twofold
