#pragma once

#include <Eigen/Core>
#include <vector>

#include "camera/camera_model.hpp"
#include "geometry/se3.hpp"
#include "selfcalibration/clip.hpp"

namespace twofold {

inline constexpr int kLensParameters = 6;
using LensVector = Eigen::Matrix<double, kLensParameters, 1>;
using LensMatrix = Eigen::Matrix<double, kLensParameters, kLensParameters>;

/// What the frames of one camera have in common, as self-calibration estimates it.
struct SharedLens {
  double log_f = 0;       ///< log of the focal length [px], fx = fy
  double k1 = 0, k2 = 0;  ///< radial distortion on the plane z = 1
  Vector2 centre{0, 0};   ///< principal point [px]
  double readout = 0;     ///< of a rolling shutter [s]
  double height = 1;      ///< of the image [px]; not estimated

  [[nodiscard]] double f() const;
  /// In the order of the fields.
  [[nodiscard]] SharedLens plus(const LensVector& step) const;
};

/// The camera's motion during a clip, and where its corners are.
struct ClipMotion {
  std::vector<SE3> T_view_first;  ///< in step with the views; the first is the identity
  std::vector<Vector3> psi;       ///< inverse depth coordinates in the first view
};

/// Normal equations of a clip, motion and corners eliminated: H step = g, whitened.
struct LensEquations {
  LensMatrix H = LensMatrix::Zero();
  LensVector g = LensVector::Zero();
};

/// Bundle adjustment of one clip whose lens may be unknown.
///
/// A corner at psi in the first view is seen in view k at
///
///   z = f d(|q|^2) q + c + s (v) readout velocity,  q = project(R_k (x, y, 1) + rho t_k),
///
/// d(r2) = 1 + k1 r2 + k2 r2^2, s = (v + 0.5) / height - 0.5: the velocity of the corner in the image, taken
/// from the frames before and after, says where it would have been at mid-exposure. A corner of which all
/// views disagree counts less (Cauchy's kernel on the mean of its squared errors).
class ClipAdjustment {
 public:
  ClipAdjustment(const Clip& clip, double sigma_px);

  ClipMotion motion;

  /// Corners that disagree count for nothing: Geman and McClure's kernel instead of Cauchy's.
  void forget_outliers() { redescending_ = true; }
  void set_sigma(double sigma_px) { sigma_ = sigma_px; }
  [[nodiscard]] double sigma() const { return sigma_; }
  /// Robust, whitened.
  [[nodiscard]] double cost(const SharedLens& lens, const ClipMotion& of) const;
  /// Standard deviation of a corner that would explain the median of the errors [px].
  [[nodiscard]] double estimated_sigma(const SharedLens& lens) const;
  /// Linearises; then `step` may be asked for.
  [[nodiscard]] LensEquations linearise(const SharedLens& lens, double damping);
  /// The motion after this step of the lens, from the last linearisation.
  [[nodiscard]] ClipMotion stepped(const LensVector& lens_step) const;
  /// Motion only, with this lens; returns the cost.
  double solve_motion(const SharedLens& lens, int max_iterations);

 private:
  struct PointBlock {
    Matrix3 V_inverse;
    Vector3 g;
    Eigen::Matrix<double, Eigen::Dynamic, 3> W;  ///< by poses and lens
  };
  struct CornerError {
    double sum = 0;    ///< of squared errors over the views that see it [variances]
    double views = 0;  ///< how many
  };
  [[nodiscard]] CornerError corner_error(const SharedLens& lens, const ClipMotion& of, std::size_t corner,
                                         double sigma_px) const;
  [[nodiscard]] int pose_size() const { return 6 * (static_cast<int>(clip_->views.size()) - 1); }
  bool add_point(const SharedLens& lens, std::size_t corner, PointBlock& block);

  const Clip* clip_;
  double sigma_;
  bool redescending_ = false;
  Eigen::MatrixXd H_;
  Eigen::VectorXd g_;
  Eigen::MatrixXd A_inverse_B_;
  Eigen::VectorXd A_inverse_g_;
  std::vector<PointBlock> blocks_;
};

}  // namespace twofold
