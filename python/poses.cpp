#include "python/poses.hpp"

#include <pybind11/pybind11.h>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace twofold::python {
namespace {

template <std::size_t N>
void expect_finite(const std::array<double, N>& values, const std::string& where, const char* name) {
  if (std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); })) return;
  throw pybind11::value_error(
      fmt::format("{}{} must be finite, is [{}]", where, name, fmt::join(values, ", ")));
}

}  // namespace

Pose checked_pose(const std::array<double, 3>& t, const std::array<double, 4>& q, const std::string& where) {
  constexpr double kTolerance = 0.01;  // as of trajectory files
  constexpr double kRounding = 1e-12;  // what is of length 1 keeps its bits
  expect_finite(t, where, "t");
  expect_finite(q, where, "q");
  const double length = std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
  if (!(std::abs(length - 1) <= kTolerance))
    throw pybind11::value_error(
        fmt::format("{}q must be of length 1, is [{}] of length {:.6g}", where, fmt::join(q, ", "), length));
  Pose pose{q, t};
  if (std::abs(length - 1) > kRounding)
    for (double& x : pose.q) x /= length;
  return pose;
}

}  // namespace twofold::python
