#include "estimation/region_sums.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace twofold {
namespace {

constexpr int kFewestRegions = 12;  // of 24: with fewer, what one region says weighs too much
constexpr int kOfPose = 6;          // dimensions

}  // namespace

void RegionSums::clear() {
  regions_.fill({Matrix6::Zero(), Vector6::Zero(), false});
  by_rows_.setZero();
}

void RegionSums::add(const Eigen::Vector2f& uv, const Matrix6& information, const Vector6& gradient) {
  const int column = static_cast<int>(uv.x() * kColumns / static_cast<float>(width_));
  const int row = static_cast<int>(uv.y() * kRows / static_cast<float>(height_));
  Region& region = regions_[static_cast<std::size_t>(std::clamp(row, 0, kRows - 1) * kColumns +
                                                     std::clamp(column, 0, kColumns - 1))];
  region.information += information;
  region.gradient += gradient;
  region.seen = true;
  by_rows_ += ((uv.y() + 0.5) / height_ - 0.5) * information;
}

std::optional<double> RegionSums::variance_factor(const Matrix6& information) const {
  const Eigen::LLT<Matrix6> llt(information);
  if (llt.info() != Eigen::Success) return std::nullopt;
  double trace = 0;
  int seen = 0;
  for (const Region& region : regions_) {
    if (!region.seen) continue;
    trace += llt.matrixL().solve(region.gradient).squaredNorm();
    ++seen;
  }
  if (seen < kFewestRegions) return std::nullopt;
  const double factor = trace / kOfPose * seen / (seen - kOfPose);
  return std::isfinite(factor) ? std::optional(factor) : std::nullopt;
}

std::optional<Matrix6> RegionSums::jackknife(const Matrix6& information) const {
  Vector6 total = Vector6::Zero();
  int seen = 0;
  for (const Region& region : regions_) {
    total += region.gradient;
    seen += region.seen ? 1 : 0;
  }
  if (seen < kFewestRegions) return std::nullopt;
  Matrix6 sum = Matrix6::Zero();
  for (const Region& region : regions_) {
    if (!region.seen) continue;
    const Eigen::LLT<Matrix6> of_others(information - region.information);
    if (of_others.info() != Eigen::Success) continue;
    const Vector6 moved = of_others.solve(region.gradient - total);
    sum.noalias() += moved * moved.transpose();
  }
  sum *= static_cast<double>(seen - 1) / seen;
  return sum.allFinite() ? std::optional(sum) : std::nullopt;
}

}  // namespace twofold
