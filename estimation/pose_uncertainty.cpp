#include "estimation/pose_uncertainty.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "estimation/observation_model.hpp"
#include "estimation/robust_kernel.hpp"

namespace twofold {
namespace {

constexpr int kColumns = 6, kRows = 4;
constexpr int kFewestRegions = 12;
constexpr int kEvery = 3;                // frames: what errors are like changes slowly
constexpr double kNewestRegions = 0.25;  // share of the newest value in the smoothed one
constexpr double kNewestSplit = 0.1;
constexpr int kPoseDimensions = 6;

/// Region of a measurement, counted in rows.
std::size_t region_of(const Rig& rig, const Eigen::Vector3f& z) {
  const int column = static_cast<int>(z.x() * kColumns / static_cast<float>(rig.camera.width));
  const int row = static_cast<int>(z.y() * kRows / static_cast<float>(rig.camera.height));
  return static_cast<std::size_t>(std::clamp(row, 0, kRows - 1) * kColumns +
                                  std::clamp(column, 0, kColumns - 1));
}

void smooth(std::optional<double>& mean, double newest, double share) {
  if (!std::isfinite(newest)) return;
  mean = mean ? *mean + share * (newest - *mean) : newest;
}

Vector6 wrench(const Vector3& force, const Vector3& x) {
  Vector6 result;
  result << force, x.cross(force);
  return result;
}

}  // namespace

void VarianceFactor::update(const Rig& rig, std::span<const MotionObservation> observations,
                            const MotionOnlyResult& motion, const MotionOnlyOptions& options) {
  if (regions_ && frames_++ % kEvery != 0) return;
  const ObservationModel model(rig);
  const HuberKernel kernel{options.huber_sigmas};
  const Matrix3 R = motion.T_c_ref.rotation();
  std::array<Vector6, kColumns * kRows> gradients;
  gradients.fill(Vector6::Zero());
  std::array<bool, kColumns * kRows> seen{};
  for (const MotionObservation& o : observations) {
    if (!o.inlier) continue;
    const Vector3 x = R * o.x_ref + motion.T_c_ref.translation();
    if (!(x.z() > kSolverMinDepth)) continue;
    const std::size_t region = region_of(rig, o.z);
    gradients[region] += wrench(model.linearise(x, o.z, o.information, kernel).force, x);
    seen[region] = true;
  }
  const auto regions = static_cast<int>(std::count(seen.begin(), seen.end(), true));
  if (regions < kFewestRegions) return;
  const Eigen::LLT<Matrix6> llt(motion.information);
  if (llt.info() != Eigen::Success) return;
  double trace = 0;
  for (const Vector6& g : gradients) trace += llt.matrixL().solve(g).squaredNorm();
  smooth(regions_, trace / kPoseDimensions * regions / (regions - kPoseDimensions), kNewestRegions);
}

void VarianceFactor::add_split(double factor) {
  smooth(split_, factor, kNewestSplit);
}

std::optional<double> split_factor(const Matrix6& information_of_all, const Matrix6& information_of_some,
                                   const Vector6& apart) {
  // (C_some - C_all)^-1 = H_some + H_some (H_all - H_some)^-1 H_some
  const Eigen::LLT<Matrix6> of_others(information_of_all - information_of_some);
  if (of_others.info() != Eigen::Success) return std::nullopt;
  const Vector6 force = information_of_some * apart;
  return (apart.dot(force) + of_others.matrixL().solve(force).squaredNorm()) / kPoseDimensions;
}

Vector6 readout_force(const Rig& rig, std::span<const MotionObservation> observations,
                      const MotionOnlyResult& motion, const Vector6& velocity,
                      const MotionOnlyOptions& options) {
  const ObservationModel model(rig);
  const HuberKernel kernel{options.huber_sigmas};
  const Matrix3 R = motion.T_c_ref.rotation();
  Vector6 sum = Vector6::Zero();
  for (const MotionObservation& o : observations) {
    if (!o.inlier) continue;
    const Vector3 x = R * o.x_ref + motion.T_c_ref.translation();
    if (!(x.z() > kSolverMinDepth)) continue;
    const double row = (o.z.y() + 0.5) / rig.camera.height - 0.5;
    const Vector3 moved = row * (velocity.head<3>() + velocity.tail<3>().cross(x));
    sum += wrench(model.linearise(x, o.z, o.information, kernel).apply(moved), x);
  }
  return sum;
}

Matrix6 information_under(const Matrix6& information, double variance_factor, const Vector6& force) {
  Matrix6 smaller = information / variance_factor;
  const Vector6 f = force / variance_factor;
  // Sherman and Morrison: (C + b b^T)^-1 with C^-1 b = f.
  const Eigen::LLT<Matrix6> llt(smaller);
  const double share = 1 + f.dot(llt.solve(f));
  if (llt.info() != Eigen::Success || !std::isfinite(share)) return smaller;
  return smaller - f * f.transpose() / share;
}

}  // namespace twofold
