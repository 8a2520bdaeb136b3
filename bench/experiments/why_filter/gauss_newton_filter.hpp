#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/measurement.hpp"
#include "estimation/linearisation.hpp"
#include "filters/anchored_views.hpp"
#include "filters/inverse_depth_filter.hpp"
#include "filters/sliding_window_filter_equations.hpp"

namespace twofold::bench {

/// How the pose of a new frame is found before the joint update.
enum class MotionEstimate : std::uint8_t {
  kMotionOnly,    ///< map taken as exact  (thesis eq. 4.15), linear in the points
  kMapPrior,      ///< Gaussian map, algorithm 6, cubic in the points
  kMapPriorOnce,  ///< algorithm 6 with the innovation covariance computed once (step 7 skipped)
};

struct GaussNewtonFilterOptions {
  double sigma_px = 0.5;  ///< of every measurement component, > 0
  int iterations = 3;  ///< Levenberg-Marquardt steps of the joint update, >= 0; 0: the motion estimate stands
  int motion_iterations = 10;      ///< of the motion estimate, >= 0
  int two_view_iterations = 60;    ///< of the monocular start from two frames, which begins far off, >= 1
  int three_view_iterations = 20;  ///< when the third frame joins, >= 1
  MotionEstimate motion = MotionEstimate::kMotionOnly;
  /// First estimates bring the filter to bundle adjustment's accuracy.
  Linearisation linearisation = Linearisation::kFirstEstimate;

  [[nodiscard]] std::string invalid_reason() const;
};

/// That a frame sees a point, with the measurement; monocular rigs ignore u_r.
struct PointObservation {
  std::int64_t point = 0;
  StereoPixel pixel = StereoPixel::Zero();
};

/// Gauss-Newton filter for visual SLAM: an iterated information filter without motion prior over a joint
/// Gaussian of anchored inverse depth points and their anchor poses  (thesis 2.3.4, 4.5.2, 4.5.3; algorithms
/// 4, 5, 6).
///
/// Order of the state: [anchor poses | points | current pose]; the origin T_0 is known and not part of it.
/// Poses T_i map the origin frame into camera i, perturbed on the left. Every joint update costs O((3N +
/// 6A)^3).
class GaussNewtonFilter {
 public:
  GaussNewtonFilter(const Rig& rig, const GaussNewtonFilterOptions& options);

  /// First frame of a stereo rig: the points and their information  (eq. 4.23, 4.24).
  void initialise(std::span<const PointObservation> first);
  /// Monocular start from three consecutive frames  (4.5.3): the first is the origin, the translation to the
  /// second defines the unit of length by a 5-DoF constraint, the third is a standard update. Then (ours) all
  /// three are linearised anew at their common minimum. Points not seen in all three are left out. False when
  /// the motion could not be estimated.
  [[nodiscard]] bool bootstrap(std::span<const PointObservation> b0, std::span<const PointObservation> b1,
                               std::span<const PointObservation> first);

  /// One time step of algorithm 5. `lost`: points no longer seen, marginalised out. `fresh`: points to add,
  /// measured in the previous frame, whose pose becomes their anchor. `current`: measurements of this frame,
  /// of old and new points. False when the joint update found no finite step; the state is then that of the
  /// motion estimate.
  bool step(std::span<const std::int64_t> lost, std::span<const PointObservation> fresh,
            std::span<const PointObservation> current);

  /// From the next step on; throws as the constructor does.
  void set_options(const GaussNewtonFilterOptions& options);

  [[nodiscard]] const SE3& T_c_w() const { return T_c_w_; }
  /// Frame from which motion counts: the first one of a stereo rig, the third of a monocular start. That one
  /// is not the origin and known from two short baselines only: it stays in the state, an anchor even
  /// without points, and gains from every later measurement.
  [[nodiscard]] const SE3& T_reference_w() const {
    return reference_ == kCurrentPose ? T_c_w_ : anchors_[static_cast<std::size_t>(reference_)];
  }
  [[nodiscard]] int point_count() const { return static_cast<int>(points_.size()); }
  [[nodiscard]] int anchor_count() const { return static_cast<int>(anchors_.size()) - 1; }
  [[nodiscard]] std::int64_t point_id(int point) const { return points_[static_cast<std::size_t>(point)].id; }
  [[nodiscard]] const Vector3& psi(int point) const { return points_[static_cast<std::size_t>(point)].psi; }
  /// Information of [anchors | points | current pose].
  [[nodiscard]] const MatrixX& information() const { return Lambda_; }
  /// 6 x 6 marginal covariance of the current pose.
  [[nodiscard]] Matrix6 pose_covariance() const;
  /// Time spent in the last joint update [s, of the calling thread's processor].
  [[nodiscard]] double joint_seconds() const { return joint_seconds_; }

 private:
  struct Point {
    std::int64_t id;
    int anchor;  ///< index into anchors_
    Vector3 psi;
    std::optional<Vector3> psi_lin = {};  ///< where derivatives are taken, once a second frame measured it
  };
  struct Mean {
    SE3 T_c_w;
    std::vector<SE3> anchors;
    std::vector<Point> points;
  };
  struct Seen {
    int point = 0;  ///< index into points_
    StereoPixel pixel = StereoPixel::Zero();
  };

  [[nodiscard]] int rows() const { return rig_.kind == SensorKind::kMono ? 2 : 3; }
  [[nodiscard]] int anchor_at(int anchor) const { return 6 * (anchor - 1); }
  [[nodiscard]] int point_at(int point) const { return 6 * anchor_count() + 3 * point; }
  [[nodiscard]] int pose_at() const { return 6 * anchor_count() + 3 * point_count(); }
  [[nodiscard]] InverseDepthFilter first_estimate(const StereoPixel& z) const;
  [[nodiscard]] std::vector<Seen> match(std::span<const PointObservation> observations) const;
  [[nodiscard]] SE3 T_c_anchor(int anchor) const {
    return T_c_w_ * anchors_[static_cast<std::size_t>(anchor)].inverse();
  }
  void add_points(std::span<const PointObservation> observations, int anchor);
  void marginalise_pose();
  void pose_becomes_anchor();
  void marginalise_points(std::span<const std::int64_t> lost);
  void append_pose();
  double add_measurements(const std::vector<Seen>& seen, MatrixX* Lambda, VectorX* g) const;
  bool joint_update(const std::vector<Seen>& seen, int iterations);
  void absorb(const std::vector<Seen>& seen);
  [[nodiscard]] AnchoredViews::View all_seen_from(const SE3& T_c_a, const std::vector<Seen>& seen) const;
  [[nodiscard]] bool start_from(const AnchoredViews& views);
  [[nodiscard]] Mean mean() const { return {T_c_w_, anchors_, points_}; }
  void set_mean(const Mean& mean);
  void move(const VectorX& delta);
  [[nodiscard]] VectorX offset(const Mean& from) const;
  void estimate_motion(const std::vector<Seen>& all);
  [[nodiscard]] std::vector<Seen> with_depth(const std::vector<Seen>& all) const;
  struct Innovation;
  class InnovationWeight;
  [[nodiscard]] std::optional<Innovation> innovation(const std::vector<Seen>& seen, bool with_map) const;
  [[nodiscard]] MatrixX map_covariance() const;
  void eliminate(const std::vector<int>& indices);

  Rig rig_;
  GaussNewtonFilterOptions options_;
  std::vector<SE3> anchors_;      ///< [0] is the origin
  std::vector<SE3> anchors_lin_;  ///< where their derivatives are taken: what they were as current poses
  std::vector<Point> points_;
  SE3 T_c_w_;
  MatrixX Lambda_;
  static constexpr int kCurrentPose = -1;
  int reference_ = 0;  ///< anchor of the reference frame, or kCurrentPose
  double joint_seconds_ = 0;
};

}  // namespace twofold::bench
