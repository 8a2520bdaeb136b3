#include "synthetic/synthetic_sequence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "synthetic/image_effects.hpp"
#include "synthetic/random.hpp"

namespace twofold::synthetic {
namespace {

constexpr std::int64_t kFirstTime = 1'000'000'000;  ///< [ns]
constexpr int kBlurViews = 6;                       ///< averaged over the exposure
enum Stream : std::uint64_t { kLeft, kRight, kDepth, kStreamsPerFrame };
constexpr std::uint64_t kDropStream = ~std::uint64_t{0};

constexpr float kHandOverLens = 12;  ///< [grey level]

Staging make_place(const SyntheticOptions& options, std::uint64_t seed) {
  if (options.scene == "courtyard") return make_courtyard(seed, options.plain);
  if (options.scene == "desk") return make_desk(seed);
  if (options.scene == "corridor") return make_corridor(seed, options.plain);
  if (options.scene == "cloister") return make_cloister(seed);
  if (options.scene == "campus") return make_campus(seed);
  if (options.scene == "descent") return make_descent(seed);
  if (options.scene == "landing") return make_landing(seed);
  if (options.scene == "terrace") return make_terrace(seed);
  if (options.scene == "turntable")
    return make_turntable(seed, {options.shape, options.texture, options.motion});
  throw std::invalid_argument("unknown scene '" + options.scene + "'");
}

Staging make_staging(const SyntheticOptions& options, std::uint64_t seed) {
  if (const std::string reason = options.invalid_reason(); !reason.empty())
    throw std::invalid_argument(reason);
  Staging staging = make_place(options, seed);
  if (options.walkers > 0)
    staging.walkers = Walkers(staging.scene, staging.path, staging.walking_speed, options.walkers, seed);
  if (options.flight > 0) staging.path = flown(staging.path, options.flight);
  if (options.bare) staging.scene.strip_textures();
  return staging;
}

/// Gain after the changes so far, when the largest is by `stops`: half of it or all, up and down.
double stepped_gain(double t, double stops) {
  constexpr double kFirst = 2.5, kHeld = 4;  // [s]
  constexpr std::array<double, 8> kStops{0, 0.5, 0, 1, 0.5, 1, 0, 0.5};
  const double steps = std::max(0.0, std::floor((t - kFirst) / kHeld) + 1);
  return std::exp2(-stops * kStops[static_cast<std::size_t>(steps) % kStops.size()]);
}

/// Lamps on mains of 50 Hz, whose phase each frame meets a little later.
double flickering(double t, double amplitude) {
  constexpr double kBeat = 7.3;  // [Hz] that a camera sees of it
  return 1 - amplitude * 0.5 * (1 + std::sin(2 * std::numbers::pi * kBeat * t));
}

}  // namespace

SyntheticSequence::SyntheticSequence(const SyntheticOptions& options)
    : options_(options), staging_(make_staging(options, options.seed)) {
  if (options.elsewhere != 0) elsewhere_ = make_staging(options, options.elsewhere);
  rig_.kind = options.sensor;
  lens_ = {options.f,     options.f,     0.5 * (options.width - 1), 0.5 * (options.height - 1),
           options.width, options.height};
  rig_.camera = lens_;
  rig_.camera.fx = rig_.camera.fy = options.f * (1 + options.f_error);
  rig_.baseline = options.sensor == SensorKind::kMono ? 0 : options.baseline;
  rig_.depth_max = options.depth_max;
  rig_.readout = options.readout;
  const std::int64_t frames =
      options.frames > 0 ? options.frames
                         : std::max(1L, std::lround(options.rounds * staging_.round_seconds * options.fps));
  for (std::int64_t i = 0; i < frames; ++i) {
    const std::uint64_t word = counter_hash(options.seed, kDropStream, static_cast<std::uint64_t>(i));
    if (i == 0 || unit_interval(word) >= options.drop) indices_.push_back(i);
  }
}

double SyntheticSequence::seconds(int i) const {
  return static_cast<double>(indices_[i]) / options_.fps;
}

std::int64_t SyntheticSequence::t_ns(int i) const {
  return kFirstTime + std::llround(seconds(i) * 1e9);
}

bool SyntheticSequence::covered(int i) const {
  return options_.cover_at > 0 && seconds(i) >= options_.cover_at && !carried(i);
}

bool SyntheticSequence::carried(int i) const {
  return options_.cover_at > 0 && seconds(i) >= options_.cover_at + options_.cover;
}

bool SyntheticSequence::in_first_place(int i) const {
  return !covered(i) && !(carried(i) && elsewhere_);
}

double SyntheticSequence::walk_seconds(int i) const {
  return carried(i) ? seconds(i) - options_.cover_at - options_.cover + options_.carried_to : seconds(i);
}

SE3 SyntheticSequence::T_w_c(int i) const {
  return staging(i).path(walk_seconds(i));
}

double SyntheticSequence::gain(int i) const {
  const double t = seconds(i);
  const double changing =
      1 - options_.exposure * 0.5 * (1 - 0.7 * std::cos(0.9 * t) - 0.3 * std::cos(2.3 * t));
  return changing * stepped_gain(t, options_.exposure_steps) * flickering(t, options_.flicker);
}

Instant SyntheticSequence::instant_at(const Staging& staging, double t, double right_m) const {
  Instant instant{staging.path(t) * SE3(SO3(), Vector3(right_m, 0, 0)), {}};
  if (options_.object && staging.T_w_object)
    instant.extra = box_quads(staging.T_w_object(t), staging.object_size, staging.object_texture);
  staging.walkers.append(t, instant.extra);
  if (staging.surroundings) staging.surroundings(t, instant.extra);
  return instant;
}

View SyntheticSequence::view_at(const Staging& staging, double t, double right_m) const {
  const Renderer renderer(staging.scene);
  if (options_.shutter == 0) {
    const Instant instant = instant_at(staging, t, right_m);
    return renderer.render(lens_, instant.T_w_c, instant.extra);
  }
  return renderer.render_rows(lens_, [&](int row) {
    const double late = ((row + 0.5) / lens_.height - 0.5) * options_.shutter;
    return instant_at(staging, std::max(0.0, t + late), right_m);
  });
}

cv::Mat SyntheticSequence::blurred(int i, double right_m) const {
  if (options_.blur == 0) return view_at(staging(i), walk_seconds(i), right_m).intensity;
  cv::Mat sum = cv::Mat::zeros(rig_.camera.height, rig_.camera.width, CV_32FC1);
  for (int k = 0; k < kBlurViews; ++k) {
    const double share = (k + 0.5) / kBlurViews - 0.5;
    const double t = std::max(0.0, walk_seconds(i) + share * options_.blur / options_.fps);
    const cv::Mat part = view_at(staging(i), t, right_m).intensity;
    for (int y = 0; y < sum.rows; ++y)
      for (int x = 0; x < sum.cols; ++x) sum.at<float>(y, x) += part.at<float>(y, x) * (1.0f / kBlurViews);
  }
  return sum;
}

Frame SyntheticSequence::behind_hand(Frame frame, const NoiseKey& left, const NoiseKey& right) const {
  const cv::Mat dark(rig_.camera.height, rig_.camera.width, CV_32FC1, cv::Scalar(kHandOverLens));
  frame.left = expose(dark, 1, options_.noise, left);
  if (rig_.kind == SensorKind::kStereo) frame.right = expose(dark, 1, options_.noise, right);
  if (rig_.kind == SensorKind::kRgbd) frame.depth = cv::Mat::zeros(dark.size(), CV_16UC1);
  return frame;
}

Frame SyntheticSequence::render(int i) const {
  Frame frame;
  frame.index = indices_[i];
  frame.t_ns = t_ns(i);
  const auto key = [&](Stream stream) {
    return NoiseKey{options_.seed, static_cast<std::uint64_t>(indices_[i]) * kStreamsPerFrame + stream};
  };
  if (covered(i)) return behind_hand(std::move(frame), key(kLeft), key(kRight));
  View left;
  if (options_.blur == 0 || rig_.kind == SensorKind::kRgbd) left = view_at(staging(i), walk_seconds(i), 0);
  frame.left =
      expose(options_.blur == 0 ? left.intensity : blurred(i, 0), gain(i), options_.noise, key(kLeft));
  if (rig_.kind == SensorKind::kStereo)
    frame.right = expose(blurred(i, rig_.baseline), gain(i), options_.noise, key(kRight));
  if (rig_.kind == SensorKind::kRgbd)
    frame.depth = sense_depth(left.inverse_depth, rig_, options_.depth_noise, key(kDepth));
  return frame;
}

View SyntheticSequence::exact_view(int i) const {
  return view_at(staging(i), walk_seconds(i), 0);
}

}  // namespace twofold::synthetic
