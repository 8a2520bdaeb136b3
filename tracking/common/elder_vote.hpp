#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "estimation/motion_only.hpp"
#include "estimation/pose_uncertainty.hpp"
#include "graph/ids.hpp"

namespace twofold {

struct ElderVoteOptions {
  double share = 1.0 / 3;           ///< of the observations: so many are elders at least, in (0, 1]
  int min_elders = 40;              ///< fewer overrule nobody, >= 3
  double min_agreeing_share = 0.7;  ///< share of the elders that the pose they give must explain, in (0, 1]
  double dissent = 4;         ///< between the two poses, in standard deviations of the elders' pose, > 0
  double newest_usual = 0.1;  ///< weight of the newest frame in the mean of that distance, in (0, 1]
  /// Share of the elders that must lie nearer to where their pose says than to where that of all does:
  /// in (0, 1].
  double min_convinced_share = 2.0 / 3;
  /// Of the young points that agree with the pose of all, the share that must agree with the elders' pose,
  /// too; with fewer the young are overruled. In (0, 1].
  double min_loyal_share = 0.5;
  int mistrusted_frames = 30;  ///< for so long nobody asks the young again, >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Whose word counts when points disagree about where the camera is: that of those known for longest.
///
/// What passes before the camera gives ever new points, whose depths are right and which agree with each
/// other, maybe more of them than of all others; but each of them is young. Elders are the observations of
/// the oldest points. When most elders fit their own pose better and most of the young points that agree with
/// the pose of all contradict it, the young move: they are overruled, and for a while their votes do not
/// count.
///
/// Standard deviations are those of the rig's noise, unless elders and all usually differ by more: where
/// images have more noise, or the map's unit of length drifts, so that old points are in another one than
/// new. What passes adds a contradiction that was not there before; one that comes slowly raises what is
/// usual, in no frame by more than one at the bound does.
///
/// One instance a tracker: it remembers whom it mistrusts, and what is usual. No allocation after
/// construction.
class ElderVote {
 public:
  /// Of one frame.
  struct Verdict {
    std::optional<MotionOnlyResult> by_elders;  ///< the pose that the elders give, when it counts instead
    /// By how much the elders' pose and that of all differ, over what independent errors of the rig's noise
    /// let expect: a variance factor (PoseUncertainty::add_split). Nothing when nobody was asked, or nobody
    /// could say.
    std::optional<double> difference;
    int mistrusted_for = 0;  ///< frames for which nobody asks the young, from the next one on
    double usual = 0;        ///< ElderVote::usual_ from the next frame on
  };

  ElderVote(const Rig& rig, std::size_t capacity, const ElderVoteOptions& options);

  /// @param observations  of one frame, at most `capacity`, which say who agrees with by_all; they then say
  /// who agrees with the pose that counts
  /// @param anchors       the keyframe that each of the points was seen in first; numbers grow with time
  /// @param by_all        the pose that all of them give
  [[nodiscard]] Verdict ask(std::span<MotionObservation> observations, std::span<const KeyframeId> anchors,
                            const MotionOnlyResult& by_all, const MotionOnlyOptions& solver);

  /// What a verdict means for the next ones.
  void remember(const Verdict& verdict) {
    mistrusted_for_ = verdict.mistrusted_for;
    usual_ = verdict.usual;
  }

  /// The young were overruled lately.
  [[nodiscard]] bool mistrusts_the_young() const { return mistrusted_for_ > 0; }

 private:
  bool choose_elders(std::span<const MotionObservation> observations, std::span<const KeyframeId> anchors);
  [[nodiscard]] MotionOnlyResult settle_elders(const MotionOnlyResult& by_elders,
                                               const MotionOnlyOptions& solver);
  [[nodiscard]] double elders_nearer_to(const SE3& T_c_ref, const SE3& T_other) const;
  [[nodiscard]] int young_inliers(std::span<MotionObservation> observations,
                                  std::span<const KeyframeId> anchors, const SE3& T_c_ref,
                                  const MotionOnlyOptions& solver) const;

  Rig rig_;
  ElderVoteOptions options_;
  int mistrusted_for_ = 0;  ///< [frames]
  /// Squared distance between the elders' pose and that of all, in variances of the former by the rig's
  /// noise: smoothed over the frames in which nobody was overruled.
  double usual_ = 0;
  KeyframeId youngest_elder_ = kNoKeyframe;  ///< anchor
  std::vector<KeyframeId> by_age_;
  std::vector<MotionObservation> elders_;
  std::vector<double> chi2_;  ///< of elders
};

}  // namespace twofold
