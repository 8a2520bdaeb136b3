#include "selfcalibration/self_calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include <fmt/format.h>

#include "base/median.hpp"
#include "base/option_check.hpp"
#include "estimation/levenberg_marquardt.hpp"
#include "geometry/symmetric_solve.hpp"
#include "selfcalibration/clip_start.hpp"

namespace twofold {
namespace {

constexpr std::array<double, 7> kTrials{0.4, 0.55, 0.75, 1.0, 1.4, 1.9, 2.6};  // focal lengths over the width
constexpr double kSupposedSigma = 0.7;                                         // [px]
constexpr double kShortest = 0.3, kLongest = 4;  // focal length over the width that is believed
constexpr double kClipKernel = 3;                // [standard deviations] of a clip's own focal length
constexpr double kLeastSigma = 0.02;             // of a corner [px]: nobody is better
constexpr int kSharpenings = 4;                  // of the weights
constexpr double kReadoutSigma = 0.002;          // [s] of a readout that is shown ...
constexpr double kReadoutSigmas = 3.5;           // ... and standard deviations that it is from none
constexpr double kFinestReadout = 0.001;         // [s] no camera is known better, as the tracker has it
constexpr int kTrialIterations = 12;
constexpr int kJointIterations = 60;
constexpr int kFollowingIterations = 5;  // of a clip's motion after a step of the lens
constexpr double kLongestStep = 0.2;     // of the logarithm of the focal length

struct ClipWeights {
  std::vector<double> of_clip;
  double spread = 1;  ///< how many times farther the clips' focal lengths scatter than their corners say
};

/// What is known of cameras before anything is seen; the focal length's is flat.
struct LensPrior {
  LensVector mean, information;
};

LensPrior prior_of(int width, int height) {
  LensPrior prior;
  const double centre = 0.015 * width;
  prior.mean << 0, 0, 0, 0.5 * (width - 1), 0.5 * (height - 1), 0;
  const LensVector sigma = (LensVector() << 1, 0.3, 0.2, centre, centre, 0.02).finished();
  prior.information = sigma.cwiseProduct(sigma).cwiseInverse();
  prior.information[0] = 0;
  return prior;
}

LensVector values(const SharedLens& lens) {
  return (LensVector() << lens.log_f, lens.k1, lens.k2, lens.centre, lens.readout).finished();
}

double prior_cost(const LensPrior& prior, const SharedLens& lens) {
  const LensVector d = values(lens) - prior.mean;
  return d.dot(prior.information.cwiseProduct(d));
}

std::vector<ClipMotion> motions_of(const std::vector<ClipAdjustment>& clips) {
  std::vector<ClipMotion> motions;
  for (const ClipAdjustment& clip : clips) motions.push_back(clip.motion);
  return motions;
}

/// The better one of two starts; returns its cost.
double solve_motion(const Clip& clip, const SharedLens& lens, ClipAdjustment& adjustment) {
  adjustment.motion = start_by_rotation(clip, lens);
  const double by_rotation = adjustment.solve_motion(lens, kTrialIterations);
  ClipMotion rotation_motion = adjustment.motion;
  adjustment.motion = start_by_essential_matrix(clip, lens);
  const double by_essential = adjustment.solve_motion(lens, kTrialIterations);
  if (by_rotation <= by_essential) adjustment.motion = std::move(rotation_motion);
  return std::min(by_rotation, by_essential);
}

/// Motions of all clips with this lens; returns the sum of their costs.
double solve_motions(const std::vector<Clip>& clips, const SharedLens& lens,
                     std::vector<ClipAdjustment>& adjustments) {
  double sum = 0;
  for (std::size_t c = 0; c < clips.size(); ++c) sum += solve_motion(clips[c], lens, adjustments[c]);
  return sum;
}

double cost_of(const std::vector<ClipAdjustment>& clips, const SharedLens& lens,
               const std::vector<double>& weights, const LensPrior& prior) {
  double cost = prior_cost(prior, lens);
  for (std::size_t c = 0; c < clips.size(); ++c) cost += weights[c] * clips[c].cost(lens, clips[c].motion);
  return cost;
}

/// A step of the lens, and then motions of the clips' own for it: they bend away from the straight line along
/// which a linear step takes them, so that a focal length that the motion hardly shows would creep instead.
void take_step(const SharedLens& stepped_lens, const LensVector& step, std::vector<ClipAdjustment>& clips) {
  for (ClipAdjustment& clip : clips) {
    clip.motion = clip.stepped(step);
    (void)clip.solve_motion(stepped_lens, kFollowingIterations);
  }
}

/// The lens alone, of which the clips' motions are functions: they are not damped, nor is the lens by them
/// (variable projection; Golub and Pereyra 2003).
void solve_all(std::vector<ClipAdjustment>& clips, const std::vector<double>& weights, const LensPrior& prior,
               SharedLens& lens) {
  LevenbergMarquardtDamping damping(1e-3);
  double cost = cost_of(clips, lens, weights, prior);
  for (int i = 0; i < kJointIterations && !damping.exhausted(); ++i) {
    LensMatrix H = prior.information.asDiagonal();
    LensVector g = prior.information.cwiseProduct(prior.mean - values(lens));
    for (std::size_t c = 0; c < clips.size(); ++c) {
      const LensEquations equations = clips[c].linearise(lens, 0);
      H += weights[c] * equations.H;
      g += weights[c] * equations.g;
    }
    H.diagonal() *= 1 + damping.lambda();
    LensVector step = solve_symmetric(H, g);
    step *= std::min(1.0, kLongestStep / std::abs(step[0]));
    std::vector<ClipMotion> before = motions_of(clips);
    const SharedLens candidate = lens.plus(step);
    take_step(candidate, step, clips);
    const double next = cost_of(clips, candidate, weights, prior);
    if (!(next < cost)) {
      for (std::size_t c = 0; c < clips.size(); ++c) clips[c].motion = std::move(before[c]);
      damping.reject();
      continue;
    }
    lens = candidate;
    damping.accept(1);
    const double decrease = cost - next;
    cost = next;
    if (decrease < 1e-6 * cost) break;
  }
}

/// A clip that sees another focal length than the others do (a moving object, motion that was misunderstood)
/// counts less.
ClipWeights weigh_clips(std::vector<ClipAdjustment>& clips, const LensPrior& prior, const SharedLens& lens) {
  std::vector<double> deviations;
  for (ClipAdjustment& clip : clips) {
    const LensEquations equations = clip.linearise(lens, 0);
    LensMatrix H = equations.H;
    H.diagonal() += prior.information;
    const LensMatrix covariance = inverse_symmetric(H);
    deviations.push_back((covariance * equations.g)[0] / std::sqrt(covariance(0, 0)));
  }
  std::vector<double> sizes;
  for (const double d : deviations) sizes.push_back(std::abs(d));
  ClipWeights weights;
  weights.spread =
      std::max(1.0, 1.4826 * median(std::span(sizes)));  // of a normal distribution's median to its deviation
  for (const double deviation : deviations) {
    const double d = deviation / (kClipKernel * weights.spread);
    weights.of_clip.push_back(1 / ((1 + d * d) * (1 + d * d)));
  }
  return weights;
}

/// Sums of the clips' gradients over clips that overlap in time: what is wrong at a time is wrong in all of
/// them.
std::vector<LensVector> grouped_gradients(const std::vector<Clip>& clips,
                                          const std::vector<LensVector>& gradients) {
  std::vector<std::size_t> order(clips.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return clips[a].views.front().t_ns < clips[b].views.front().t_ns;
  });
  std::vector<LensVector> groups;
  std::int64_t group_end = std::numeric_limits<std::int64_t>::min();
  for (const std::size_t c : order) {
    if (clips[c].views.front().t_ns >= group_end) {
      groups.push_back(LensVector::Zero());
      group_end = clips[c].views.back().t_ns;
    }
    groups.back() += gradients[c];
  }
  const auto n = static_cast<double>(groups.size());
  for (LensVector& g : groups) g *= std::sqrt(n / std::max(1.0, n - 1));
  return groups;
}

SharedLens supposed_lens(const LensPrior& prior, double f, int height) {
  SharedLens lens;
  lens.log_f = std::log(f);
  lens.centre = prior.mean.segment<2>(3);
  lens.height = height;
  return lens;
}

/// The best of some focal lengths, and the motions that go with it.
SharedLens coarse_search(const std::vector<Clip>& clips, const LensPrior& prior, int width, int height,
                         std::vector<ClipAdjustment>& adjustments) {
  SharedLens best_lens;
  std::vector<ClipMotion> best_motions;
  double best = std::numeric_limits<double>::infinity();
  for (const double trial : kTrials) {
    const SharedLens lens = supposed_lens(prior, trial * width, height);
    const double cost = solve_motions(clips, lens, adjustments);
    if (!(cost < best) && !best_motions.empty()) continue;  // also when it is not a number
    best = cost;
    best_lens = lens;
    best_motions = motions_of(adjustments);
  }
  for (std::size_t c = 0; c < clips.size(); ++c) adjustments[c].motion = std::move(best_motions[c]);
  return best_lens;
}

/// Motions that were misunderstood with another lens get a second chance.
void solve_motions_again(const std::vector<Clip>& clips, const SharedLens& lens,
                         std::vector<ClipAdjustment>& adjustments) {
  for (std::size_t c = 0; c < clips.size(); ++c) {
    ClipAdjustment& clip = adjustments[c];
    ClipMotion present = clip.motion;
    const double cost = clip.cost(lens, present);
    (void)solve_motion(clips[c], lens, clip);
    if (clip.cost(lens, clip.motion) > cost) clip.motion = std::move(present);
  }
}

void estimate_sigmas(const SharedLens& lens, std::vector<ClipAdjustment>& clips) {
  for (ClipAdjustment& clip : clips) clip.set_sigma(std::max(kLeastSigma, clip.estimated_sigma(lens)));
}

/// Standard deviations of the lens.
LensVector lens_sigma(const std::vector<Clip>& clips, std::vector<ClipAdjustment>& adjustments,
                      const ClipWeights& weights, const LensPrior& prior, const SharedLens& lens) {
  LensMatrix H = prior.information.asDiagonal();
  LensMatrix scatter = prior.information.asDiagonal();
  std::vector<LensVector> gradients;
  for (std::size_t c = 0; c < clips.size(); ++c) {
    const LensEquations equations = adjustments[c].linearise(lens, 0);
    H += weights.of_clip[c] * equations.H;
    gradients.emplace_back(weights.of_clip[c] * equations.g);
  }
  for (const LensVector& g : grouped_gradients(clips, gradients)) scatter += g * g.transpose();
  const LensMatrix covariance = inverse_symmetric(H);
  const LensVector by_corners = weights.spread * covariance.diagonal().cwiseSqrt();
  return by_corners.cwiseMax((covariance * scatter * covariance).diagonal().cwiseSqrt());
}

bool shows_readout(const SelfCalibration& found) {
  return found.readout_sigma < kReadoutSigma && found.lens.readout > kReadoutSigmas * found.readout_sigma;
}

std::string refusal_of(const SelfCalibration& found, int width, const SelfCalibrationOptions& options) {
  const double f = found.lens.f(), sigma = found.sigma[0];
  const bool credible = f >= kShortest * width && f <= kLongest * width && std::isfinite(sigma);
  if (credible && sigma <= options.max_sigma) return {};
  const std::string known = credible ? fmt::format(" ({:.0f} px +- {:.0f} %, at most {:.0f} % are of use)", f,
                                                   100 * sigma, 100 * options.max_sigma)
                                     : "";
  return "the camera's motion does not show its focal length" + known +
         ": turn it to the sides, up and down, and about its optical axis";
}

}  // namespace

std::string SelfCalibrationOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("min_clips", static_cast<double>(min_clips), 2)
      .above("max_sigma", max_sigma, 0)
      .at_least("systematic_sigma", systematic_sigma, 0)
      .reason();
}

tl::expected<SelfCalibration, std::string> self_calibrate(const std::vector<Clip>& clips, int width,
                                                          int height, const SelfCalibrationOptions& options) {
  if (clips.size() < options.min_clips) {
    return tl::unexpected(fmt::format(
        "the camera moved too little, or too few corners could be followed: {} short stretches of video are "
        "of use, at least {} are needed",
        clips.size(), options.min_clips));
  }
  const LensPrior prior = prior_of(width, height);
  std::vector<ClipAdjustment> adjustments;
  for (const Clip& clip : clips) adjustments.emplace_back(clip, kSupposedSigma);
  SelfCalibration found;
  found.clips = clips.size();
  found.lens = coarse_search(clips, prior, width, height, adjustments);
  ClipWeights weights{std::vector<double>(clips.size(), 1), 1};
  for (int round = 0; round < 3; ++round) {
    solve_all(adjustments, weights.of_clip, prior, found.lens);
    solve_motions_again(clips, found.lens, adjustments);
    estimate_sigmas(found.lens, adjustments);
  }
  for (ClipAdjustment& clip : adjustments) clip.forget_outliers();
  for (int round = 0; round < kSharpenings; ++round) {
    solve_all(adjustments, weights.of_clip, prior, found.lens);
    estimate_sigmas(found.lens, adjustments);
    weights = weigh_clips(adjustments, prior, found.lens);
  }
  solve_all(adjustments, weights.of_clip, prior, found.lens);
  found.sigma = lens_sigma(clips, adjustments, weights, prior, found.lens);
  found.f_sigma = found.lens.f() * std::hypot(found.sigma[0], options.systematic_sigma);
  found.readout_sigma = std::hypot(found.sigma[5], kFinestReadout);
  std::vector<double> corner_sigmas;
  for (const ClipAdjustment& clip : adjustments) corner_sigmas.push_back(clip.sigma());
  found.corner_sigma_px = median(std::span(corner_sigmas));
  if (std::string refusal = refusal_of(found, width, options); !refusal.empty())
    return tl::unexpected(std::move(refusal));
  return found;
}

Calibration to_calibration(const SelfCalibration& found, int width, int height) {
  Calibration calibration;
  calibration.kind = SensorKind::kMono;
  const double f = found.lens.f();
  calibration.left.pinhole = {f, f, found.lens.centre.x(), found.lens.centre.y(), width, height};
  calibration.left.distortion.model = DistortionModel::kRadTan;
  calibration.left.distortion.coefficients = {found.lens.k1, found.lens.k2, 0, 0, 0};
  if (shows_readout(found)) calibration.readout = found.lens.readout;
  return calibration;
}

}  // namespace twofold
