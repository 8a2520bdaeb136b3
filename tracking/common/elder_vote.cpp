#include "tracking/common/elder_vote.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/median.hpp"
#include "base/option_check.hpp"
#include "estimation/median_chi2.hpp"
#include "estimation/observation_model.hpp"

namespace twofold {
namespace {

constexpr double kExpected = 6;  // squared distance of poses, which have so many dimensions

}  // namespace

std::string ElderVoteOptions::invalid_reason() const {
  return OptionCheck()
      .share("share", share)
      .at_least("min_elders", min_elders, 3)
      .share("min_agreeing_share", min_agreeing_share)
      .above("dissent", dissent, 0)
      .share("newest_usual", newest_usual)
      .share("min_convinced_share", min_convinced_share)
      .share("min_loyal_share", min_loyal_share)
      .at_least("mistrusted_frames", mistrusted_frames, 0)
      .reason();
}

ElderVote::ElderVote(const Rig& rig, std::size_t capacity, const ElderVoteOptions& options)
    : rig_(rig), options_(options) {
  by_age_.reserve(capacity);
  elders_.reserve(capacity);
  chi2_.reserve(capacity);
}

ElderVote::Verdict ElderVote::ask(std::span<MotionObservation> observations,
                                  std::span<const KeyframeId> anchors, const MotionOnlyResult& by_all,
                                  const MotionOnlyOptions& solver) {
  const bool mistrusted = mistrusts_the_young();
  Verdict verdict;
  verdict.usual = usual_;
  if (mistrusted) verdict.mistrusted_for = mistrusted_for_ - 1;
  if (!choose_elders(observations, anchors)) return verdict;
  MotionOnlyResult by_elders = optimise_motion(rig_, elders_, by_all.T_c_ref, solver);
  if (by_elders.inliers < options_.min_agreeing_share * static_cast<double>(elders_.size())) return verdict;

  if (mistrusted) by_elders = settle_elders(by_elders, solver);
  const Vector6 apart = (by_all.T_c_ref * by_elders.T_c_ref.inverse()).log();
  verdict.difference = split_factor(by_all.information, by_elders.information, apart);
  const double distance = apart.dot(by_elders.information * apart);
  const double bound = options_.dissent * options_.dissent * std::max(1.0, usual_ / kExpected);
  const bool dissent =
      distance > bound && elders_nearer_to(by_elders.T_c_ref, by_all.T_c_ref) >= options_.min_convinced_share;
  // One frame beyond the bound, of whose poses one may be anywhere, says no more than one at the bound.
  const double usual = usual_ + options_.newest_usual * (std::min(distance, bound) - usual_);
  if (!mistrusted) verdict.usual = usual;
  if (!dissent && !mistrusted) return verdict;  // nearly always
  const int with_elders = young_inliers(observations, anchors, by_elders.T_c_ref, solver);
  const int with_all = young_inliers(observations, anchors, by_all.T_c_ref, solver);
  const bool misled = dissent && with_elders < options_.min_loyal_share * with_all;
  if (misled) {
    verdict.mistrusted_for = options_.mistrusted_frames;
    verdict.usual = usual_;
  }
  if (!misled && !mistrusted) return verdict;
  by_elders.inliers = classify_observations(rig_, observations, by_elders.T_c_ref, solver);
  verdict.by_elders = by_elders;
  return verdict;
}

/// Elders that what passes hides are looked for all the same, and some are found on it, by chance and near to
/// where they would be seen: within the bound for outliers, which is wide (real errors have long tails), and
/// with their depths wrong. Where the others lie says how wide it is in this frame.
MotionOnlyResult ElderVote::settle_elders(const MotionOnlyResult& by_elders,
                                          const MotionOnlyOptions& solver) {
  const ObservationModel model(rig_);
  chi2_.clear();
  for (const MotionObservation& o : elders_) {
    if (o.inlier) chi2_.push_back(model.chi2(by_elders.T_c_ref * o.x_ref, o.pixel, o.information));
  }
  if (chi2_.empty()) return by_elders;
  const double usual = median_chi2(rig_.kind == SensorKind::kMono ? 2 : 3);
  const double narrower = std::min(1.0, median(std::span(chi2_)) / usual);
  MotionOnlyOptions strict = solver;
  strict.huber_sigmas *= std::sqrt(narrower);
  strict.inlier_chi2_mono *= narrower;
  strict.inlier_chi2_stereo *= narrower;
  const MotionOnlyResult settled = optimise_motion(rig_, elders_, by_elders.T_c_ref, strict);
  return settled.converged ? settled : by_elders;
}

/// @return false when they are too few, or when nobody is younger
bool ElderVote::choose_elders(std::span<const MotionObservation> observations,
                              std::span<const KeyframeId> anchors) {
  const auto share = static_cast<std::size_t>(options_.share * static_cast<double>(observations.size()));
  const std::size_t wanted = std::max(static_cast<std::size_t>(options_.min_elders), share);
  if (observations.size() <= wanted) return false;
  by_age_.assign(anchors.begin(), anchors.end());
  const auto last = by_age_.begin() + static_cast<std::ptrdiff_t>(wanted - 1);
  std::nth_element(by_age_.begin(), last, by_age_.end());
  youngest_elder_ = *last;
  elders_.clear();
  for (std::size_t i = 0; i < observations.size(); ++i) {
    if (anchors[i] <= youngest_elder_) elders_.push_back(observations[i]);
  }
  return elders_.size() < observations.size();
}

/// Share of the elders that lie nearer to where the first pose says than to where the second does. Few far
/// points leave a pose nearly free, and two mistakes among them carry it off, which the most of them show:
/// what they gain in all, the sum, does not.
double ElderVote::elders_nearer_to(const SE3& T_c_ref, const SE3& T_other) const {
  const ObservationModel model(rig_);
  int count = 0;
  for (const MotionObservation& o : elders_) {
    count += model.chi2(T_c_ref * o.x_ref, o.pixel, o.information) <
             model.chi2(T_other * o.x_ref, o.pixel, o.information);
  }
  return static_cast<double>(count) / static_cast<double>(elders_.size());
}

/// How many of the young go with a pose. Sets who goes with it, old and young.
int ElderVote::young_inliers(std::span<MotionObservation> observations, std::span<const KeyframeId> anchors,
                             const SE3& T_c_ref, const MotionOnlyOptions& solver) const {
  classify_observations(rig_, observations, T_c_ref, solver);
  int count = 0;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    count += observations[i].inlier && anchors[i] > youngest_elder_ ? 1 : 0;
  }
  return count;
}

}  // namespace twofold
