#pragma once

#include <cmath>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "camera/measurement.hpp"
#include "camera/rig.hpp"
#include "estimation/linearisation.hpp"
#include "filters/process_model.hpp"
#include "filters/sliding_window_filter_factor.hpp"
#include "filters/sliding_window_filter_prior.hpp"

namespace twofold {

/// What happens to a pose that leaves the window.
enum class PoseRemoval : std::uint8_t {
  kMarginalise,          ///< Schur complement into the prior  (SWF eq. 10)
  kMarginaliseDiagonal,  ///< VSDF: only the blocks of the Schur complement on the diagonal  (eq. 12)
  kMarginaliseEntries,   ///< eq. 12 as printed, single entries of the diagonal: what is left need not be
                         ///< positive definite, and is not once depth is much less certain than direction
  kDelete  ///< visual odometry: its information is dropped, the oldest pose left is fixed (4.2.4)
};

struct SlidingWindowOptions {
  int window = 10;  ///< k, poses kept, >= 0; 0: all (batch / full SLAM). 1: iterated extended Kalman filter
  PoseRemoval removal = PoseRemoval::kMarginalise;
  /// kFirstEstimate works as kCurrent for window 1 (the iterated EKF), where a pose enters the prior as a
  /// mere prediction, before it is measured.
  Linearisation linearisation = Linearisation::kFirstEstimate;
  /// A landmark is marginalised when no pose of the window, the new frame included, sees it. true: it stays
  /// (its information is in the prior), so that it can be seen again; the state then grows with the map.
  bool keep_unseen_landmarks = false;

  bool robust = true;         ///< Huber kernel, threshold from the inliers' spread  (SWF 3.1.3)
  double huber_sigmas = 2.0;  ///< threshold, in standard deviations of the inliers' whitened components, > 0
  double min_inlier_sigma =
      0.3;                  ///< ... which is taken for this at least, so that noise-free data have one, > 0
  int min_spread_dof = 30;  ///< ... and for 1 with fewer surplus measurements than this to tell it from, >= 1
  int max_iterations = 10;  ///< Gauss-Newton steps an update, >= 0
  double stop_decrement = 1e-4;  ///< stop when g^T delta, the expected fall of the cost, is smaller, >= 0
  bool reuse_factor = true;    ///< later steps of a frame's updates keep the first factor while they contract
                               ///< fast; the fixed point is the same
  double initial_damping = 0;  ///< Levenberg-Marquardt term to start with, absolute, >= 0
  bool motion_only_start = true;  ///< a new pose is first fitted to the landmarks already known
  double min_disparity_px = 0.1;  ///< of a measurement that starts a landmark, > 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// That a frame sees a landmark, with the measurement; one of the left image alone cannot start a landmark.
struct LandmarkObservation {
  std::int64_t landmark = 0;
  StereoPixel pixel = StereoPixel::Zero();
  Matrix3 information =
      Matrix3::Identity();  ///< R^-1 [1/px^2]; without a right coordinate the top-left 2 x 2 block counts
};

struct FilterFrame {
  std::optional<MotionInput> motion;  ///< from the previous frame; none: uniform prior on the pose
  std::optional<SE3> T_c_w_start;     ///< start value when there is no motion; default: the previous pose
  std::vector<LandmarkObservation> observations;  ///< at most one a landmark
};

struct FilterSummary {
  int iterations = 0;
  int factorisations = 0;
  bool converged = false;  ///< stop_decrement reached; otherwise the best state found is kept
  double cost = 0;         ///< r^T r / 2 over prior, motion and (robust) measurements
  int poses = 0;
  int landmarks = 0;
  int landmarks_marginalised = 0;
  int outliers = 0;         ///< measurements beyond the Huber threshold
  double inlier_sigma = 0;  ///< standard deviation of the whitened inlier residuals
};

/// Sliding window filter  (Sibley, Matthies, Sukhatme 2010): maximum a posteriori estimate of the last k
/// poses and the landmarks they see, from three sources of information: prior, process model and measurements
/// (eq. 1-7). What leaves the window is marginalised into the prior (eq. 8-10).
///
/// One implementation spans window = 0: batch least squares; 1: iterated EKF; k between; kDelete: visual
/// odometry; kMarginaliseDiagonal: VSDF. Poses T_c_w map world to camera, perturbed on the left.
///
/// The information form is used, not a square root: a pose is eliminated through the Cholesky factor of its
/// own small block and the fill-in is subtracted as Y^T Y, O(n^2) a frame, where re-triangularising a
/// square-root prior is O(n^3); tests compare both on an ill-conditioned problem
/// (tests/filters/swf_marginalisation_test.cpp).
///
/// Frame l of the window. Measurements say nothing about where the whole window stands in the world: the
/// prior alone knows, and ever less the longer the path. With first estimates the state is kept in a frame l
/// that follows the landmarks of the prior as a rigid body: what a step moves them together moves l against
/// the world, and everything else with it, without an error of second order. Steps within l stay as short as
/// the local geometry makes them, and first estimates keep their place in front of the cameras.
class SlidingWindowFilter {
 public:
  /// Throws std::runtime_error when the options are invalid.
  SlidingWindowFilter(const Rig& rig, const SlidingWindowOptions& options);

  /// First pose and its prior information (gauge). Call once, before the first step.
  /// `information` none: the first pose is fixed while it is in the window; its removal then leaves the
  /// landmarks the information they have relative to it.
  void set_first_pose(const SE3& T_c_w, const std::optional<Matrix6>& information);

  /// One time step  (SWF 3.1): add the pose, remove parameters, add landmarks, update.
  FilterSummary step(const FilterFrame& frame);
  /// The steps without the update, for callers that optimise once at the end.
  void add(const FilterFrame& frame);
  FilterSummary optimise();
  /// At most so many Gauss-Newton steps; for callers that measure again in between.
  FilterSummary optimise(int max_iterations);

  [[nodiscard]] int pose_count() const { return static_cast<int>(poses_.size()); }
  [[nodiscard]] int landmark_count() const { return static_cast<int>(landmarks_.size()); }
  /// 0 is the oldest pose in the window.
  [[nodiscard]] SE3 T_c_w(int pose) const {
    return poses_[static_cast<std::size_t>(pose)].T_c_l * T_w_l_.inverse();
  }
  [[nodiscard]] SE3 newest_T_c_w() const { return T_c_w(pose_count() - 1); }
  /// Frame number (counted from 0 over all steps) of a pose in the window.
  [[nodiscard]] std::int64_t frame_of(int pose) const { return poses_[static_cast<std::size_t>(pose)].frame; }
  [[nodiscard]] std::int64_t landmark_id(int landmark) const {
    return ids_[static_cast<std::size_t>(landmark)];
  }
  [[nodiscard]] Vector3 landmark(int landmark) const {
    return T_w_l_ * points_[static_cast<std::size_t>(landmark)];
  }
  [[nodiscard]] std::optional<Vector3> find_landmark(std::int64_t id) const;
  /// In the frame l of the window.
  [[nodiscard]] const FilterPrior& prior() const { return prior_; }

  /// Covariances at the current estimate, in the order of pose(i) and landmark(i); zero for a fixed pose.
  /// None when the information matrix is singular.
  [[nodiscard]] std::optional<FilterCovariances> covariances();

  /// Replaces a measurement of a frame in the window, number of poses as for T_c_w(); false when that frame
  /// does not see the landmark.
  bool set_measurement(int pose, std::int64_t id, const StereoPixel& z);

 private:
  struct Observation {
    int landmark;  ///< index in the state
    StereoPixel pixel;
    Matrix3 information;
  };
  struct Pose {
    std::int64_t frame = 0;
    SE3 T_c_l;
    std::optional<MotionInput> motion;  ///< from the previous pose in the window
    std::vector<Observation> observations;
  };
  struct ObservationTerm {  ///< r, its derivatives and weighted information at the current estimate
    Vector3 r;
    Matrix36 J_pose;
    Matrix3 J_landmark;
    Matrix3 information;
    bool valid = false;
  };

  struct WhitenedError {
    double chi2 = 0;
    int rows = 0;  ///< components: 3, 2 of the left image alone, 0 behind the camera
  };

  void remove_oldest(const FilterFrame& frame);
  void delete_oldest(const std::vector<bool>& drop);
  void marginalise_oldest(const std::vector<bool>& drop);
  struct Blanket;
  [[nodiscard]] Blanket blanket_of_oldest(const std::vector<bool>& drop) const;
  void add_prior(Blanket& blanket) const;
  void add_measurements(Blanket& blanket) const;
  void add_motion(Blanket& blanket) const;
  void make_prior(Blanket& blanket);
  /// Sizes of the diagonal blocks of the fill-in that the sparse filters keep: kept landmarks, next pose.
  [[nodiscard]] std::vector<int> fill_in_blocks(std::size_t landmarks) const;
  void compact_landmarks(const std::vector<int>& order);
  void add_observations(const FilterFrame& frame);
  void fit_newest_pose(const FilterFrame& frame);
  [[nodiscard]] ObservationTerm linearise(int pose, const Observation& observation) const;
  [[nodiscard]] MotionError linearise_motion(int pose) const;
  [[nodiscard]] WhitenedError whitened_error(int pose, const Observation& observation) const;
  /// Threshold on the norm of a whitened residual with so many components; 0: none.
  [[nodiscard]] double huber(int rows) const { return huber_ * std::sqrt(rows / 3.0); }
  void build_equations();
  void add_prior();
  void add_measurements(int pose);
  void add_motion(int pose);
  [[nodiscard]] double cost() const;
  void update_threshold();
  /// Where derivatives are taken: the prior's point for what the prior knows, if first_estimates().
  [[nodiscard]] bool pose_is_linearised_at_prior(int pose) const;
  [[nodiscard]] const SE3& pose_lin(int pose) const;
  [[nodiscard]] const Vector3& landmark_lin(int landmark) const;
  struct Estimate {
    std::vector<SE3> T_c_l;
    std::vector<Vector3> points;
    Vector6 shift;
  };
  [[nodiscard]] Estimate estimate() const;
  void set_estimate(const Estimate& estimate);
  bool factorise(double damping);
  /// g^T delta of step_, the expected fall of the cost.
  [[nodiscard]] double decrement() const;
  [[nodiscard]] double allowed_rise(double cost, double promised) const;
  void apply(const FilterStep& step);
  void move_frame();
  [[nodiscard]] bool first_estimates() const {
    return options_.linearisation == Linearisation::kFirstEstimate && options_.window != 1;
  }

  Rig rig_;
  SlidingWindowOptions options_;
  std::deque<Pose> poses_;
  struct LandmarkRecord {
    int observations = 0;  ///< in the window
  };
  std::vector<LandmarkRecord> landmarks_;  ///< parallel to points_ and ids_; prior landmarks first
  std::vector<Vector3> points_;            ///< in l
  std::vector<std::int64_t> ids_;
  std::unordered_map<std::int64_t, int> index_;  ///< id to position; never iterated
  FilterPrior prior_;
  SE3 T_w_l_;                        ///< identity unless first_estimates()
  Vector6 shift_ = Vector6::Zero();  ///< of frame l against the world since optimise() began
  bool oldest_fixed_ = false;
  std::int64_t next_frame_ = 0;
  SE3 first_T_c_w_;
  double huber_ = 0;  ///< threshold on the norm of three whitened components; 0: none
  FilterSummary summary_;
  FilterEquations equations_;
  FilterFactor factor_;
  bool factor_serves_ = false;  ///< factor_ is of this frame's state, at some estimate of it
  FilterStep step_;
};

}  // namespace twofold
