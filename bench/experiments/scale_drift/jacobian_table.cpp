// Table 5.1: Campbell-Baker-Hausdorff Jacobians of the first three orders against numerical ones.
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>

#include "experiments/scale_drift/experiments.hpp"
#include "geometry/cbh.hpp"

namespace twofold::bench {
namespace {

constexpr std::array<double, 3> kSigmas = {0.0005, 0.015, 0.5};

/// Means over the samples, in the table's columns; norms of matrices are Frobenius norms: the first row's
/// |J_num - J_1| / |d| = 1 / sqrt(2) is that of [d]x / 2.
struct Row {
  double d = 0;
  std::array<double, 3> error{};      ///< of orders 1, 2, 3 against forward differences
  std::array<double, 3> truncated{};  ///< of orders 1, 2, 3 against the whole series
  double whole = 0;                   ///< of the whole series against central differences
};

/// The table as printed.
constexpr std::array<std::array<std::array<double, 4>, 3>, 3> kPrinted = {{
    {{{8.0622e-4, 5.7008e-4, 8.7931e-8, 1.2267e-10},
      {2.5554e-2, 1.8070e-2, 8.5531e-5, 7.8969e-9},
      {7.7543e-1, 5.5622e-1, 8.6935e-2, 1.9021e-3}}},
    {{{1.1390e-3, 1.0167e-3, 1.5861e-7, 3.0536e-10},
      {3.6641e-2, 3.2604e-2, 1.6346e-4, 6.3008e-9},
      {1.1857, 1.0576, 1.6580e-1, 3.1948e-3}}},
    {{{1.5068e-3, 1.7052e-3, 2.9849e-7, 4.7997e-10},
      {4.3008e-2, 4.9284e-2, 2.4271e-4, 1.1705e-8},
      {1.5567, 1.7407, 2.9783e-1, 6.8600e-3}}},
}};

/// d log(A exp(e) B) / d e at e = 0 by differences; central: error in h^2 instead of h.
template <class Group>
typename Group::AdjointMatrix numerical_jacobian(const Group& A, const Group& B, double h, bool central) {
  typename Group::AdjointMatrix J;
  const auto at = [&](int k, double step) {
    typename Group::Tangent e = Group::Tangent::Zero();
    e[k] = step;
    return typename Group::Tangent((A * Group::exp(e) * B).log());
  };
  for (int k = 0; k < Group::kDof; ++k) {
    J.col(k) = central ? (at(k, h) - at(k, -h)) / (2 * h) : (at(k, h) - at(k, 0)) / h;
  }
  return J;
}

template <class Group>
Row row(double sigma, const ScaleDriftOptions& options, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> unit(0, 1);
  Row sum;
  for (int i = 0; i < options.samples; ++i) {
    typename Group::Tangent a, b;
    for (int k = 0; k < Group::kDof; ++k) a[k] = options.spread * unit(rng);
    for (int k = 0; k < Group::kDof; ++k) b[k] = -a[k] + sigma * unit(rng);
    const Group A = Group::exp(a), B = Group::exp(b);
    const typename Group::Tangent d = (A * B).log();
    const auto J_num = numerical_jacobian(A, B, options.step, false);
    const auto J_exact = pose_pose_jacobian(A, d, CbhOrder::kExact);
    sum.d += d.norm() / options.samples;
    for (const int order : {1, 2, 3}) {
      const auto J = pose_pose_jacobian(A, d, static_cast<CbhOrder>(order));
      const auto o = static_cast<std::size_t>(order - 1);
      sum.error[o] += (J_num - J).norm() / options.samples;
      sum.truncated[o] += (J_exact - J).norm() / options.samples;
    }
    sum.whole += (numerical_jacobian(A, B, 1e-5, true) - J_exact).norm() / options.samples;
  }
  return sum;
}

/// Largest factor by which two positive numbers differ.
double factor(double a, double b) {
  return std::max(a / b, b / a);
}

}  // namespace

void jacobian_experiment(const ScaleDriftOptions& options, Report& report) {
  const std::array<std::string, 3> names = {"SO(3)", "SE(3)", "Sim(3)"};
  std::vector<std::vector<double>> rows;
  std::array<double, 4> worst{};  // of |d| and the three orders
  double whole = 0;
  auto table = nlohmann::json::array();
  for (std::size_t g = 0; g < names.size(); ++g) {
    for (std::size_t s = 0; s < kSigmas.size(); ++s) {
      const unsigned seed = options.seed + static_cast<unsigned>(3 * g + s);
      const Row r = g == 0   ? row<SO3>(kSigmas[s], options, seed)
                    : g == 1 ? row<SE3>(kSigmas[s], options, seed)
                             : row<Sim3>(kSigmas[s], options, seed);
      const auto& printed = kPrinted[g][s];
      worst[0] = std::max(worst[0], factor(r.d, printed[0]));
      for (std::size_t o = 0; o < 3; ++o)
        worst[o + 1] = std::max(worst[o + 1], factor(r.error[o], printed[o + 1]));
      whole = std::max(whole, r.whole);
      rows.push_back({static_cast<double>(g), kSigmas[s], r.d, r.error[0], r.error[1], r.error[2],
                      r.truncated[0], r.truncated[1], r.truncated[2], printed[0], printed[1], printed[2],
                      printed[3]});
      table.push_back({{"group", names[g]},
                       {"sigma", kSigmas[s]},
                       {"d", r.d},
                       {"error", r.error},
                       {"truncated", r.truncated},
                       {"printed", printed}});
    }
  }
  report.json()["table5_1"] = table;
  report.csv(
      "table5_1.csv",
      {"group (0 SO3, 1 SE3, 2 Sim3)", "sigma", "|d|", "|J_num - J_1|", "|J_num - J_2|", "|J_num - J_3|",
       "|J - J_1|", "|J - J_2|", "|J - J_3|", "|d| printed", "1 printed", "2 printed", "3 printed"},
      rows);
  const std::array<std::string, 4> columns = {"|d|", "order 1", "order 2", "order 3"};
  for (std::size_t c = 0; c < columns.size(); ++c) {
    report.state("thesis table 5.1", columns[c] + " within a factor of 2 of the printed figures",
                 text("largest factor %.2f over nine cells", worst[c]), worst[c] <= 2);
  }
  report.state("thesis 5.3.3", "the whole series is the Jacobian (central differences, below 1e-9)",
               text("largest mean difference %.1e", whole), whole < 1e-9);
}

}  // namespace twofold::bench
