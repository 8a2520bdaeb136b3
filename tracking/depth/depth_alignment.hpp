#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <tl/expected.hpp>

#include "camera/rig.hpp"
#include "estimation/motion_only.hpp"
#include "estimation/region_sums.hpp"
#include "graph/ids.hpp"
#include "tracking/common/lost_cause.hpp"
#include "tracking/depth/depth_planes.hpp"

namespace twofold {

struct DepthAlignmentOptions {
  DepthPlaneOptions planes;
  int max_iterations = 12;     ///< >= 1
  int min_planes = 100;        ///< in the depth image, >= 6
  double min_met_share = 0.4;  ///< share of them that must be met in some view, in (0, 1]
  double kernel = 2;           ///< scale of the robust kernel (Cauchy) [standard deviations] > 0
  // By what measured surfaces are bent, beyond noise: lenses, and what the sensor assumes.
  double normal_sigma = 0.01;   ///< [rad] >= 0
  double depth_sigma = 0.0005;  ///< [share of the depth] >= 0
  /// Share of the information about any direction that may be owed to noise, in (0, 1].
  double max_chance_share = 0.5;
  double max_sigma_m = 0.02;    ///< the pose is refused when known worse than this in some direction, > 0
  double max_sigma_rad = 0.01;  ///< likewise
  int min_corners = 8;          ///< with fewer they are left out, >= 3
  // Which planes of frame and view are one surface.
  double max_apart = 0.1;   ///< [share of the depth] > 0
  double min_facing = 0.8;  ///< cosine between their normals, in [-1, 1]
  // Corners err like planes, but some are found somewhere else.
  double corner_huber = 1.5;     ///< [standard deviations] > 0
  double max_corner_chi2 = 30;   ///< farther ones are mistakes, > 0
  double max_kernel = 30;        ///< that it begins with, >= kernel [standard deviations]
  double jackknife_share = 0.5;  ///< of the covariance, that is from leaving regions out, in [0, 1]
  double max_deviation = 30;     ///< of a plane, counts as no farther [standard deviations] > 0
  // How it is solved: neither changes the pose by as much as a tenth of what that is uncertain by.
  double settled_step = 2e-5;  ///< [m, rad] > 0
  double nearly_settled_step =
      1e-3;              ///< until then every first_stride-th plane is looked at, >= settled_step
  int first_stride = 4;  ///< >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Places a depth camera where there are hardly any corners: aligns what it measures to what keyframes
/// measured.
///
/// Minimises, over the frame's pose, how far its surface points lie from the planes of several keyframes,
/// along the view's ray and as a share of the depth (Chen and Medioni, 1992; projective association) together
/// with the reprojection errors of what corners there are. Planes from noisy readings seem to differ in
/// direction even when they are one: of the information J^T W J a part is owed to that, which is known from
/// the planes' covariance, and taken off (errors in variables). A direction that mostly chance determines,
/// along a bare wall or a corridor without ends, is refused and not guessed.
///
/// Half of the covariance is from how far the pose moves when each region of the image is left out
/// (RegionSums, jackknife): lens, shutter and sensor bend surfaces together, and a pose that hangs on the end
/// of a corridor is known as well as that end.
///
/// Bounded work, no allocation after construction.
class DepthAlignment {
 public:
  static constexpr std::size_t kViews = 4;

  DepthAlignment(const Rig& rig, const DepthAlignmentOptions& options);

  /// The keyframes to align to, at most kViews. Planes of one that is added after every clear_views() are
  /// kept and not made anew.
  void clear_views() { views_ = 0; }
  /// @param depth       as Frame::depth, of the rig
  /// @param T_view_ref  pose of the reference of `align`'s T_c_ref, in the view's frame
  void add_view(KeyframeId id, const cv::Mat& depth, const SE3& T_view_ref);

  /// Reads the frame to be placed.
  void look_at(const cv::Mat& depth) { current_.read(depth); }

  struct Result {
    SE3 T_c_ref;
    Matrix6 covariance;   ///< of T_c_ref, left perturbation (v, omega)
    Matrix6 information;  ///< if each plane erred by itself: J^T W J, what is owed to chance taken off
    Matrix6 all;          ///< J^T W J
    Matrix6 by_rows;      ///< RegionSums::by_rows
    double met = 0;       ///< share of the frame's planes that were met
  };
  /// @param T_c_ref  prediction
  /// @param corners  found in the frame, in the reference's frame; may be none
  /// @return  the pose; kTooFewMatches when too little is common to frame and views, kNoStructure when
  ///          something of the pose is left open
  [[nodiscard]] tl::expected<Result, LostCause> align(const SE3& T_c_ref,
                                                      std::span<const MotionObservation> corners) const;

  /// Whether the frame looked at would be placed relative to itself: kNone, kNoStructure or kTooFewMatches.
  [[nodiscard]] LostCause judge_structure() const;

  /// Of the frame looked at [m].
  [[nodiscard]] double typical_depth() const { return current_.typical_depth(); }

 private:
  struct ViewPlanes {
    ViewPlanes(const Rig& rig, const DepthPlaneOptions& options) : planes(rig, options) {}
    KeyframeId id = kNoKeyframe;
    SE3 T_view_ref;
    DepthPlanes planes;
  };
  /// Normal equations over a left perturbation of T_c_ref.
  struct Equations {
    Matrix6 H = Matrix6::Zero();
    Matrix6 chance = Matrix6::Zero();  ///< expected part of H that noise in the planes makes
    Vector6 g = Vector6::Zero();
    double deviations = 0;  ///< sum of |residual| / sigma
    double squares = 0;     ///< weighted, likewise
    double weights = 0;
    int pairs = 0;
    int met = 0;  ///< planes of the frame
  };
  struct Pass {
    double kernel;
    std::size_t stride;  ///< every so many planes of the frame
    bool with_chance;
  };
  /// @param regions  adds what each plane of the frame says; may be null
  [[nodiscard]] Equations linearise(const SE3& T_c_ref, const Pass& pass,
                                    RegionSums* regions = nullptr) const;
  /// What a plane of the frame and one of a view say of the pose.
  struct Pair {
    Vector3 m_c;                     ///< the view's plane in the frame's axes
    const DepthPlanes::Plane* view;  ///< in the view's own
    Matrix3 R_view_c;
    double residual;  ///< (z - z of the plane on that ray) / z of the plane
    double variance;  ///< of the view's part of the residual
  };
  [[nodiscard]] std::optional<Pair> pair_up(const DepthPlanes::Plane& seen, const DepthPlanes::Plane& plane,
                                            const SE3& T_view_c) const;
  void add_pairs(const DepthPlanes::Plane& seen, std::span<const Pair> pairs, const Pass& pass,
                 Equations& equations) const;
  void add_corners(const SE3& T_c_ref, std::span<const MotionObservation> corners, bool settling,
                   Equations& equations, RegionSums* regions = nullptr) const;
  [[nodiscard]] std::optional<Matrix6> determined(const Equations& equations,
                                                  const Matrix6& of_corners) const;
  [[nodiscard]] tl::expected<Result, LostCause> judge(const SE3& T_c_ref,
                                                      std::span<const MotionObservation> corners) const;

  Rig rig_;
  DepthAlignmentOptions options_;
  std::vector<ViewPlanes> slots_;
  std::size_t views_ = 0;                    ///< in use
  std::array<std::size_t, kViews> order_{};  ///< slots of those
  DepthPlanes current_;
};

}  // namespace twofold
