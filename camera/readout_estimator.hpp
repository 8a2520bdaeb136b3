#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// A point as one frame saw it.
struct ReadoutPoint {
  std::uint64_t key = 0;   ///< the same in every frame that sees the point
  Vector2 uv{0, 0};        ///< where it was found, on level 0 [px]
  double depth = 0;        ///< [m] measured, or as good as known
  double sigma_px = 0.5;   ///< of uv
  double depth_error = 0;  ///< standard deviation of the inverse depth, as a share of it
};

struct ReadoutEstimate {
  double seconds = 0;  ///< from the exposure of the first row to that of the last
  double sigma = std::numeric_limits<double>::infinity();  ///< its standard deviation [s]
  int pairs = 0;                                           ///< of frames that it rests on
  bool significant = false;                                ///< beyond doubt that it is not zero
};

/// When a readout is learnt from two frames, and when it is believed.
struct ReadoutOptions {
  // A pair of frames.
  int min_points = 20;        ///< that both see, >= 6
  double gross_sigmas = 15;   ///< a point farther off was found somewhere else, > 0
  double huber_sigmas = 1.5;  ///< of a point, > 0
  double min_turn_change =
      0.05;  ///< of the angular velocity [rad/s]: with less there is nothing to learn, >= 0
  /// Frames farther apart are seldom: velocities are then of third order in time [s] > 0.
  double seldom_interval = 0.11;
  /// There, the share of that change which a straight line through the neighbours' motions misses, in (0, 1]:
  /// beyond, the camera turns to and fro faster than frames follow it, velocities are too small and the
  /// readout too large.
  double max_missed_share = 0.2;
  double max_jitter =
      0.35;               ///< of the time between frames, as a share of it: beyond, one is missing, in (0, 1]
  int pair_points = 160;  ///< of those that both see, that count, >= 6: bounds the work
  int pose_iterations = 3;  ///< of a pair, >= 1
  double nearest_share =
      0.05;                 ///< of its depth in the frame before: what comes so near leaves the image, > 0
  int mean_intervals = 32;  ///< the usual interval is the mean of about so many, >= 4
  // All pairs together.
  int first_guess = 8;        ///< pairs after which pairs are linearised at the estimate, >= 1
  double pair_sigma = 0.003;  ///< of one pair's answer, beside its points' noise [s] >= 0
  double pair_huber = 2;      ///< standard deviations beyond which a pair counts less, > 0
  int min_pairs = 8;          ///< for a belief, >= 1: what is mapped before is bent and stays so
  /// Standard deviations beyond which the readout is not zero, > 0. A camera has a global shutter or one that
  /// takes a share of the period T, and neither is the likelier before: at 3.5 sigma the odds are sqrt(2 pi)
  /// sigma / T exp(3.5^2 / 2), 300 to one at sigma = T / 4.
  double significant_sigmas = 3.5;
  double finest_sigma = 0.001;  ///< [s] no camera is known better than that, >= 0
  // The end of learning.
  double exact_enough = 0.0015;  ///< [s] > 0: known so well ...
  int pairs_to_know = 20;        ///< ... from so many pairs, >= 1
  int pairs_to_give_up = 600;    ///< with so many, whatever was found, >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// How long a rolling shutter takes to read a frame out, from pairs of consecutive frames and without the
/// map, which bends along with the poses that were estimated as if all rows were exposed at once.
///
/// A point seen at x in frame k-1, on a row tau' after mid-exposure, is expected in frame k at
///
///   z = project(exp(tau xi_k) T_k,k-1 exp(-tau' xi_k-1) x),   tau = ((v + 0.5) / height - 0.5) readout.
///
/// Per pair the pose T_k,k-1 is eliminated (Schur complement), which leaves one equation h readout = b; these
/// are summed. While the velocity xi stays the same the readout hides in the pose; where a rotation speeds up
/// or turns back, it shears one image against the other by readout f (omega_k - omega_k-1). So only pairs
/// count in which it does. Where translation dominates, errors of depth look like a readout: of a point whose
/// depth is not measured, what is seen along its epipolar line counts the less the farther its depth may have
/// moved it there. The depths of one camera's map are bent by the readout itself.
///
/// Velocities are central differences of the pairs' poses. Where frames are seldom these are too small, by a
/// third when a camera nods once a second at 5 frames a second: there, velocities are of third order in time,
/// from the motions of the four intervals around a frame. Elsewhere these would add noise only. Time stamps
/// jitter by more than a camera's clock does, and that would look like a change of velocity: frames are taken
/// to follow each other regularly.
///
/// The standard deviation is that of the scatter of pairs about the common estimate, not of the pixels: what
/// is wrong in a pair (velocity, depth) is wrong for all of its points.
///
/// No allocation after construction; per frame at most pose_iterations poses from pair_points points each.
/// Once the estimate is exact enough nothing more is done.
class ReadoutEstimator {
 public:
  /// @param max_points  that a frame sees at most
  ReadoutEstimator(const Rig& rig, std::size_t max_points, const ReadoutOptions& options = {});

  /// The next frame, which the last one's successor is.
  /// @param T_cur_prev  its pose relative to the last one, roughly
  /// @return room for at most max_points points that it sees, empty; null: nothing is wanted of it
  [[nodiscard]] std::vector<ReadoutPoint>* begin_frame(std::int64_t t_ns, const SE3& T_cur_prev);
  /// After the points were filled in.
  void end_frame();
  /// The next frame does not follow the last one: a frame was lost.
  void interrupt() { linked_ = 0; }

  [[nodiscard]] const ReadoutEstimate& estimate() const { return estimate_; }

 private:
  static constexpr std::size_t kFrames = 6;
  using Velocity = Vector6;  ///< left perturbation a second

  struct SeenFrame {
    std::int64_t t_ns = 0;
    SE3 T_cur_prev;       ///< as the tracker has it, then from the pair itself
    bool solved = false;  ///< the latter
    bool usable = false;
    bool sorted = false;
    std::vector<ReadoutPoint> points;
  };
  /// A point of frame k-1 and where it is in frame k.
  struct PairPoint {
    Vector3 x_prev{0, 0, 1};
    Vector2 uv{0, 0};
    double row_prev = 0, row = 0;  ///< (v + 0.5) / height - 0.5
    double weight = 0;
    double depth_error = 0;
  };
  struct PairEquations;

  /// `age` 0 is the newest frame.
  [[nodiscard]] SeenFrame& frame(std::size_t age) { return frames_[(newest_ + kFrames - age) % kFrames]; }
  [[nodiscard]] bool regular(std::int64_t interval_ns);
  [[nodiscard]] bool seldom() const { return period_ > options_.seldom_interval; }
  /// Of the pair that is asked, its newer frame's: velocities need frames before and after it.
  [[nodiscard]] std::size_t newer_age() const { return seldom() ? 2 : 1; }
  [[nodiscard]] Velocity mean_velocity(std::size_t age);
  [[nodiscard]] Velocity velocity(std::size_t age);
  [[nodiscard]] bool turn_changes();
  void join_points(std::size_t age);
  void solve_pair(std::size_t age);
  [[nodiscard]] PairEquations equations(const SE3& T_cur_prev, const Velocity& before,
                                        const Velocity& now) const;
  void add_pair();

  const Rig rig_;
  const ReadoutOptions options_;
  std::array<SeenFrame, kFrames> frames_;
  std::size_t newest_ = 0;
  std::size_t linked_ = 0;  ///< newest frames that follow each other
  double period_ = 0;       ///< of the frames [s]
  int intervals_ = 0;       ///< that it is the mean of
  std::vector<PairPoint> pair_;

  double readout_ = 0;  ///< that the next pair is linearised at [s]
  // Sums over the pairs' equations h readout = b.
  double h_ = 0, b_ = 0, hh_ = 0, hb_ = 0, bb_ = 0;
  ReadoutEstimate estimate_;
};

}  // namespace twofold
