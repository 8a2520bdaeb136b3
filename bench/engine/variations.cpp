// Whether a result is luck: the same recording with its first one, two, three frames left out and with noise
// of one grey level added; and whether the tracker knows how well it knows the pose (NEES).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <exception>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "engine/engine.hpp"
#include "evaluation/evaluation.hpp"
#include "io/sources/open_source.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "synthetic/image_effects.hpp"

namespace twofold {
namespace {

struct Variation {
  const char* name;
  int left_out = 0;  ///< frames at the beginning
  double noise = 0;  ///< [grey]
};

/// One variation's outcome.
struct Outcome {
  std::size_t frames = 0, tracked = 0;
  double ate = 0, ate_causal = 0;  ///< [m]
  std::vector<double> nees;        ///< of each frame's pose relative to its reference keyframe, over 6
};

cv::Mat with_noise(const cv::Mat& image, double sigma, std::uint64_t stream) {
  if (image.empty() || sigma == 0) return image;
  cv::Mat intensity;
  image.convertTo(intensity, CV_32FC1);
  return synthetic::expose(intensity, 1, sigma, {17, stream});
}

/// Between the true poses before and after; none where these are farther apart than a frame.
std::optional<SE3> true_T_w_c(const Trajectory& truth, std::int64_t t_ns) {
  constexpr std::int64_t kSameTime = 1'000;
  constexpr std::int64_t kFarApart = 60'000'000;
  const auto after = std::lower_bound(truth.begin(), truth.end(), t_ns - kSameTime,
                                      [](const TimedPose& pose, std::int64_t t) { return pose.t_ns < t; });
  if (after == truth.end()) return std::nullopt;
  if (after->t_ns <= t_ns + kSameTime) return after->T_w_c;
  if (after == truth.begin()) return std::nullopt;
  const TimedPose &a = *(after - 1), &b = *after;
  if (b.t_ns - a.t_ns > kFarApart) return std::nullopt;
  const double share = static_cast<double>(t_ns - a.t_ns) / static_cast<double>(b.t_ns - a.t_ns);
  return a.T_w_c * SE3::exp(share * (a.T_w_c.inverse() * b.T_w_c).log());
}

double ate(const Trajectory& estimate, const Trajectory& truth, Alignment alignment) {
  const auto evaluation = evaluate(associate(estimate, truth, 20'000'000), {.alignment = alignment});
  return evaluation ? evaluation->absolute.rmse : -1;
}

Outcome run(const std::string& text, const SourceOptions& source_options, const Variation& variation) {
  const std::unique_ptr<FrameSource> source = open_source(text, source_options);
  const Trajectory& truth = source->ground_truth();
  Outcome outcome;
  EngineOptions options;
  options.deterministic = true;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  const bool to_scale = source->rig().kind != SensorKind::kMono;  // lengths are comparable with the truth's
  options.on_pose = [&](const PoseReport& report) {
    const FrameRecord& record = report.record;
    if (!to_scale) return;
    if (record.state != FrameState::kTracked || !report.graph.contains(record.reference)) return;
    if (report.graph.keyframe(record.reference).t_ns == record.t_ns) return;
    const auto T_w_now = true_T_w_c(truth, record.t_ns);
    const auto T_w_then = true_T_w_c(truth, report.graph.keyframe(record.reference).t_ns);
    if (!T_w_now || !T_w_then) return;
    const SE3 T_c_ref = T_w_now->inverse() * *T_w_then;
    const Vector6 error = (record.T_c_ref.unpacked() * T_c_ref.inverse()).log();
    outcome.nees.push_back(error.dot(report.information * error) / 6);
  };
  int read = 0;
  const FrameFeed feed = [&](Frame& frame) {
    FrameStatus status = source->next(frame);
    for (; status == FrameStatus::kFrame && read < variation.left_out; ++read) status = source->next(frame);
    if (status != FrameStatus::kFrame)
      return status == FrameStatus::kEnd ? FeedStatus::kEnd : FeedStatus::kError;
    const auto stream = static_cast<std::uint64_t>(2 * frame.index);
    frame.left = with_noise(frame.left, variation.noise, stream);
    frame.right = with_noise(frame.right, variation.noise, stream + 1);
    return FeedStatus::kFrame;
  };
  const std::atomic<bool> interrupted{false};
  const RunResult result = Engine(source->rig(), options).run(feed, interrupted);
  if (!result.error.empty()) throw std::runtime_error(text + ": " + result.error);
  Trajectory estimate, causal;
  for (const FrameRecord& record : result.frames) {
    ++outcome.frames;
    if (!has_final_pose(record) || !result.graph.contains(record.reference)) continue;
    if (record.state == FrameState::kPlacedLater) {
      estimate.push_back({record.t_ns, final_T_c_w(record, result.graph).inverse()});
      continue;
    }
    ++outcome.tracked;
    estimate.push_back({record.t_ns, final_T_c_w(record, result.graph).inverse()});
    causal.push_back({record.t_ns, record.T_c_w_causal.unpacked().inverse()});
  }
  const Alignment alignment = to_scale ? Alignment::kSe3 : Alignment::kSim3;
  outcome.ate = ate(estimate, truth, alignment);
  outcome.ate_causal = ate(causal, truth, alignment);
  return outcome;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return -1;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

void print_row(const Variation& variation, const Outcome& outcome) {
  double mean = 0;
  for (const double nees : outcome.nees) mean += nees / static_cast<double>(outcome.nees.size());
  const std::string nees = outcome.nees.empty()
                               ? "-"
                               : fmt::format("{:.2f} / {:.2f} / {:.2f}", quantile(outcome.nees, 0.5), mean,
                                             quantile(outcome.nees, 0.95));
  fmt::print("| {} | {}/{} | {:.5f} | {:.5f} | {} |\n", variation.name, outcome.tracked, outcome.frames,
             outcome.ate, outcome.ate_causal, nees);
  std::fflush(stdout);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  std::vector<std::string> sources;
  twofold::SourceOptions options;
  std::string calibration;
  bool as_it_is_only = false;
  std::string camera = "all";
  CLI::App app("Runs of one recording that should differ by little");
  app.add_option("source", sources, "as of 'twofold run'")->required();
  app.add_option("--calib", calibration, "calibration file for all of them");
  app.add_option("--camera", camera, "mono: the left camera alone, errors after alignment with scale")
      ->check(CLI::IsMember({"all", "mono"}));
  app.add_flag("--only-as-it-is", as_it_is_only, "no variations");
  CLI11_PARSE(app, argc, argv);
  if (!calibration.empty()) options.calibration = calibration;
  options.left_only = camera == "mono";
  const twofold::Variation variations[] = {{"as it is"},
                                           {"first frame left out", 1},
                                           {"first two left out", 2},
                                           {"first three left out", 3},
                                           {"noise of one grey level", 0, 1}};
  try {
    for (const std::string& source : sources) {
      fmt::print(
          "\n| {} | tracked | ATE m | causal m | NEES / 6: median / mean / p95 |\n|---|---|---|---|---|\n",
          source);
      for (const twofold::Variation& variation : variations) {
        print_row(variation, twofold::run(source, options, variation));
        if (as_it_is_only) break;
      }
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "variations: {}\n", error.what());
    return 1;
  }
  return 0;
}
