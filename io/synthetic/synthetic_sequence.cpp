#include "io/synthetic/synthetic_sequence.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/synthetic/image_effects.hpp"
#include "io/synthetic/random.hpp"

namespace twofold::synthetic {
namespace {

constexpr std::int64_t kFirstTime = 1'000'000'000;  ///< [ns]
constexpr int kBlurViews = 6;                       ///< averaged over the exposure
enum Stream : std::uint64_t { kLeft, kRight, kDepth, kStreamsPerFrame };
constexpr std::uint64_t kDropStream = ~std::uint64_t{0};

Staging make_staging(const SyntheticOptions& options) {
  if (const std::string reason = options.invalid_reason(); !reason.empty())
    throw std::invalid_argument(reason);
  if (options.scene == "courtyard") return make_courtyard(options.seed);
  if (options.scene == "desk") return make_desk(options.seed);
  if (options.scene == "corridor") return make_corridor(options.seed);
  if (options.scene == "descent") return make_descent(options.seed);
  throw std::invalid_argument("unknown scene '" + options.scene + "'");
}

}  // namespace

SyntheticSequence::SyntheticSequence(const SyntheticOptions& options)
    : options_(options), staging_(make_staging(options)) {
  rig_.kind = options.sensor;
  rig_.camera = {options.f,     options.f,     0.5 * (options.width - 1), 0.5 * (options.height - 1),
                 options.width, options.height};
  rig_.baseline = options.sensor == SensorKind::kMono ? 0 : options.baseline;
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

SE3 SyntheticSequence::T_w_c(int i) const {
  return staging_.path(seconds(i));
}

double SyntheticSequence::gain(int i) const {
  const double t = seconds(i);
  return 1 - options_.exposure * 0.5 * (1 - 0.7 * std::cos(0.9 * t) - 0.3 * std::cos(2.3 * t));
}

View SyntheticSequence::view_at(double t, double right_m) const {
  const SE3 T_w_c = staging_.path(t) * SE3(SO3(), Vector3(right_m, 0, 0));
  std::vector<Quad> moving;
  if (options_.object && staging_.T_w_object)
    moving = box_quads(staging_.T_w_object(t), staging_.object_size, staging_.object_texture);
  return Renderer(staging_.scene).render(rig_.camera, T_w_c, moving);
}

cv::Mat SyntheticSequence::blurred(int i, double right_m) const {
  if (options_.blur == 0) return view_at(seconds(i), right_m).intensity;
  cv::Mat sum = cv::Mat::zeros(rig_.camera.height, rig_.camera.width, CV_32FC1);
  for (int k = 0; k < kBlurViews; ++k) {
    const double share = (k + 0.5) / kBlurViews - 0.5;
    const double t = std::max(0.0, seconds(i) + share * options_.blur / options_.fps);
    const cv::Mat part = view_at(t, right_m).intensity;
    for (int y = 0; y < sum.rows; ++y)
      for (int x = 0; x < sum.cols; ++x) sum.at<float>(y, x) += part.at<float>(y, x) * (1.0f / kBlurViews);
  }
  return sum;
}

Frame SyntheticSequence::render(int i) const {
  Frame frame;
  frame.index = indices_[i];
  frame.t_ns = t_ns(i);
  const auto key = [&](Stream stream) {
    return NoiseKey{options_.seed, static_cast<std::uint64_t>(indices_[i]) * kStreamsPerFrame + stream};
  };
  View left;
  if (options_.blur == 0 || rig_.kind == SensorKind::kRgbd) left = view_at(seconds(i), 0);
  frame.left =
      expose(options_.blur == 0 ? left.intensity : blurred(i, 0), gain(i), options_.noise, key(kLeft));
  if (rig_.kind == SensorKind::kStereo)
    frame.right = expose(blurred(i, rig_.baseline), gain(i), options_.noise, key(kRight));
  if (rig_.kind == SensorKind::kRgbd)
    frame.depth = sense_depth(left.inverse_depth, rig_, options_.depth_noise, key(kDepth));
  return frame;
}

View SyntheticSequence::exact_view(int i) const {
  return view_at(seconds(i), 0);
}

}  // namespace twofold::synthetic
