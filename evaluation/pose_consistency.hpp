#pragma once

#include <cstdint>
#include <optional>

#include "evaluation/trajectory.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// By how much a true path is wrong itself, one standard deviation of each axis.
struct TruthNoise {
  double position = 0;  ///< [m]
  double rotation = 0;  ///< [rad]
  double clock = 0;     ///< of the times of frames relative to the truth's, one frame by itself [s]
};

/// Whether estimated relative poses are as exact as their covariances say, measured against a path that has
/// errors of its own.
class RelativeTruth {
 public:
  /// @param truth  in the order of time
  RelativeTruth(Trajectory truth, const TruthNoise& noise);

  /// Error e, T_c_ref = exp(e) true T_c_ref, and the covariance of the truth's part in it (v, omega).
  struct Comparison {
    Vector6 error;
    Matrix6 of_truth;
    /// Squared error over its covariance and the six dimensions: 1 on average where that is honest (NEES /
    /// 6).
    /// @param covariance  of T_c_ref, left perturbation
    [[nodiscard]] double normalised(const Matrix6& covariance) const;
  };
  /// @param T_c_ref  estimated pose of the camera at time t_c relative to where it was at time t_ref
  /// @return  nothing where the truth has no poses around these times
  [[nodiscard]] std::optional<Comparison> compare(const SE3& T_c_ref, std::int64_t t_c_ns,
                                                  std::int64_t t_ref_ns) const;

 private:
  [[nodiscard]] std::optional<SE3> T_w_c(std::int64_t t_ns) const;
  [[nodiscard]] std::optional<SE3> T_c_ref(std::int64_t t_c_ns, std::int64_t t_ref_ns) const;

  Trajectory truth_;
  TruthNoise noise_;
};

}  // namespace twofold
