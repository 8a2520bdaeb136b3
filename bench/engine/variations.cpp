// Whether a result is luck: the same recording with its first one, two, three frames left out and with noise
// of one grey level added, darker, cropped, smaller, seen in a mirror; how far apart its frames may be; the
// recording played backwards, and there and back again, which nothing was tuned on; with --hard, what real
// cameras do to it; and whether the tracker knows how well it knows the pose (NEES).
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <exception>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/median.hpp"
#include "bench/engine/hardships.hpp"
#include "engine/engine.hpp"
#include "evaluation/evaluation.hpp"
#include "fixtures/pose_consistency.hpp"
#include "io/sources/open_source.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "synthetic/image_effects.hpp"

namespace twofold {
namespace {

enum class Order : std::uint8_t { kForwards, kBackwards, kThereAndBack };

struct Variation {
  std::string name;
  int left_out = 0;       ///< frames at the beginning
  double noise = 0;       ///< [grey]
  double gain = 1;        ///< of grey levels
  double crop = 1;        ///< share of width and height that is left, around the middle
  double scale = 1;       ///< of width and height
  bool mirrored = false;  ///< left and right exchanged, the cameras of a pair too
  int every = 1;          ///< frames from one that is taken to the next
  Order order = Order::kForwards;
  const Hardship* hardship = nullptr;  ///< befalls what is left after all that
};

/// Of one frame, with what the tracker said of it.
struct RelativePose {
  std::int64_t frame_index = 0;
  SE3 T_c_ref;
  std::int64_t t_c_ns = 0, t_ref_ns = 0;
  Matrix6 covariance;
};

/// What became of a frame.
struct FrameOutcome {
  FrameRecord record;
  std::size_t rank = 0;  ///< of its part of the final map, 0 the largest
  double error = -1;     ///< of its final position, if it is in the largest part [m]
};

/// How far a frame's pose relative to its reference keyframe is from the truth.
struct PoseError {
  std::int64_t frame_index = 0, t_c_ns = 0, t_ref_ns = 0;
  Vector6 error, sigma;  ///< sigma: said, with the truth's own [m, rad]
  double nees = 0;       ///< over 6
};

/// One variation's outcome.
struct Outcome {
  std::vector<FrameOutcome> each;  ///< of its frames

  std::size_t frames = 0, tracked = 0;
  std::vector<std::size_t> parts;  ///< frames in each part of the final map, the largest first
  double ate = 0, ate_causal = 0;  ///< of the largest; causal: of the part that most frames named then [m]
  /// True lengths over those of the largest part, and what is left of `ate` once they are alike [m].
  double scale = 1, ate_to_scale = -1;
  double clock = 0;              ///< scatter of time stamps [s]
  std::vector<PoseError> poses;  ///< relative to the frame's reference keyframe
};

/// -1 of none.
double quantile(std::vector<double> values, double share) {
  return values.empty() ? -1 : twofold::quantile(values, share, QuantileRank::kLower);
}

/// The middle of an image of this size.
cv::Rect middle(const cv::Size& size, double share) {
  const int x = static_cast<int>(size.width * (1 - share) / 2),
            y = static_cast<int>(size.height * (1 - share) / 2);
  return {x, y, size.width - 2 * x, size.height - 2 * y};
}

cv::Size scaled(const cv::Size& size, double scale) {
  return {static_cast<int>(size.width * scale), static_cast<int>(size.height * scale)};
}

/// Another shape of the image; depth is never mixed with its neighbour's.
cv::Mat reshaped(const cv::Mat& image, const Variation& variation) {
  if (image.empty()) return image;
  cv::Mat out = variation.crop == 1 ? image : image(middle(image.size(), variation.crop)).clone();
  const bool is_depth = out.type() == CV_16UC1;
  if (variation.scale != 1)
    cv::resize(out.clone(), out, scaled(out.size(), variation.scale), 0, 0,
               is_depth ? cv::INTER_NEAREST : cv::INTER_AREA);
  if (variation.mirrored) {
    cv::Mat flipped;
    cv::flip(out, flipped, 1);
    out = flipped;
  }
  return out;
}

cv::Mat exposed(const cv::Mat& image, const Variation& variation, std::uint64_t stream) {
  if (image.empty() || (variation.noise == 0 && variation.gain == 1)) return image;
  cv::Mat intensity;
  image.convertTo(intensity, CV_32FC1);
  return synthetic::expose(intensity, variation.gain, variation.noise, {17, stream});
}

/// False if the frame is lost on its way. `t` counts from the recording's first frame [s].
bool vary(Frame& frame, const Variation& variation, double t) {
  frame.left = reshaped(frame.left, variation);
  frame.right = reshaped(frame.right, variation);
  frame.depth = reshaped(frame.depth, variation);
  if (variation.mirrored && !frame.right.empty()) std::swap(frame.left, frame.right);
  const auto stream = static_cast<std::uint64_t>(2 * frame.index);
  frame.left = exposed(frame.left, variation, stream);
  frame.right = exposed(frame.right, variation, stream + 1);
  return variation.hardship == nullptr || variation.hardship->befall(frame, t);
}

/// The rig that takes such images.
Rig varied(Rig rig, const Variation& variation) {
  PinholeCamera& camera = rig.camera;
  const cv::Rect kept = middle({camera.width, camera.height}, variation.crop);
  if (rig.readout) *rig.readout *= static_cast<double>(kept.height) / camera.height;
  camera.cx -= kept.x;
  camera.cy -= kept.y;
  const cv::Size size = scaled(kept.size(), variation.scale);
  const double scale_x = static_cast<double>(size.width) / kept.width;
  const double scale_y = static_cast<double>(size.height) / kept.height;
  camera.fx *= scale_x;
  camera.fy *= scale_y;
  camera.cx = (camera.cx + 0.5) * scale_x - 0.5;
  camera.cy = (camera.cy + 0.5) * scale_y - 0.5;
  camera.width = size.width;
  camera.height = size.height;
  if (variation.mirrored) camera.cx = camera.width - 1 - camera.cx;
  if (variation.hardship != nullptr) variation.hardship->miscalibrate(rig);
  return rig;
}

/// A path as seen in the mirror x -> -x of world and camera. The right camera of a pair becomes the left one:
/// `baseline` to the right of where the pose was.
Trajectory varied(Trajectory truth, const Rig& rig, const Variation& variation) {
  if (!variation.mirrored) return truth;
  const Eigen::DiagonalMatrix<double, 3> mirror(-1, 1, 1);
  const double shift = rig.kind == SensorKind::kStereo ? rig.baseline : 0;
  for (TimedPose& pose : truth) {
    const Vector3 left = pose.T_w_c * Vector3(shift, 0, 0);
    const Matrix3 R = mirror * pose.T_w_c.rotation().matrix() * mirror;
    pose.T_w_c = SE3(Matrix3(R), mirror * left);
  }
  return truth;
}

std::vector<Frame> read_all(FrameSource& source) {
  std::vector<Frame> frames;
  FrameStatus status{};
  for (Frame frame; (status = source.next(frame)) == FrameStatus::kFrame;) {
    frames.push_back(frame);
    for (cv::Mat* image : {&frames.back().left, &frames.back().right, &frames.back().depth})
      *image = image->clone();
  }
  if (status == FrameStatus::kError) throw std::runtime_error(source.error());
  return frames;
}

/// Frames or poses as if the recording were played in another order; backwards, time is mirrored at its end.
template <class Timed>
std::vector<Timed> reordered(const std::vector<Timed>& forwards, Order order, std::int64_t end_ns) {
  if (order == Order::kForwards) return forwards;
  std::vector<Timed> out;
  if (order == Order::kThereAndBack) out = forwards;
  for (auto item = forwards.rbegin(); item != forwards.rend(); ++item) {
    if (order == Order::kThereAndBack && item->t_ns >= end_ns) continue;  // it turns at the last frame
    out.push_back(*item);
    out.back().t_ns = 2 * end_ns - item->t_ns;
  }
  return out;
}

/// How far the time stamps of frames scatter about regular ones, which the camera's clock gives [s];
/// intervals that a frame is missing in are left out.
class ClockJitter {
 public:
  void add(std::int64_t t_ns) {
    if (last_ns_) intervals_.push_back(1e-9 * static_cast<double>(t_ns - *last_ns_));
    last_ns_ = t_ns;
  }
  [[nodiscard]] double sigma() const {
    if (intervals_.size() < 2) return 0;
    const double usual = quantile(intervals_, 0.5);
    double squares = 0, sum = 0, count = 0;
    for (const double interval : intervals_) {
      if (std::abs(interval - usual) > 0.35 * usual) continue;
      squares += interval * interval, sum += interval, ++count;
    }
    const double variance = squares / count - (sum / count) * (sum / count);
    return std::sqrt(std::max(0.0, variance) / 2);  // both ends of an interval err
  }

 private:
  std::optional<std::int64_t> last_ns_;
  std::vector<double> intervals_;
};

/// Which part of the final map each frame is in, and how far from the truth.
void judge_frames(const std::map<KeyframeId, Trajectory>& of_parts, const RunResult& result,
                  const Trajectory& truth, Alignment alignment, std::vector<FrameOutcome>& frames) {
  std::vector<std::pair<std::size_t, KeyframeId>> parts;
  for (const auto& [part, trajectory] : of_parts) parts.emplace_back(trajectory.size(), part);
  std::sort(parts.rbegin(), parts.rend());
  std::map<std::int64_t, double> errors;
  if (!parts.empty()) {
    const auto evaluation =
        evaluate(associate(of_parts.at(parts[0].second), truth, 20'000'000), {.alignment = alignment});
    for (std::size_t i = 0; evaluation && i < evaluation->pairs.size(); ++i)
      errors[evaluation->pairs[i].t_ns] = evaluation->position_errors[i];
  }
  for (FrameOutcome& frame : frames) {
    if (!has_final_pose(frame.record) || !result.graph.contains(frame.record.reference)) continue;
    const KeyframeId part = result.graph.part(frame.record.reference);
    const auto at = std::find_if(parts.begin(), parts.end(), [&](const auto& p) { return p.second == part; });
    frame.rank = static_cast<std::size_t>(at - parts.begin());
    if (const auto error = errors.find(frame.record.t_ns); frame.rank == 0 && error != errors.end())
      frame.error = error->second;
  }
}

double ate(const Trajectory& estimate, const Trajectory& truth, Alignment alignment) {
  const auto evaluation = evaluate(associate(estimate, truth, 20'000'000), {.alignment = alignment});
  return evaluation ? evaluation->absolute.rmse : -1;
}

/// How much of an error is the path's length: a wrong baseline and disparities that are all off by as much
/// show in nothing else.
void judge_scale(const Trajectory& estimate, const Trajectory& truth, Outcome& outcome) {
  const auto evaluation = evaluate(associate(estimate, truth, 20'000'000), {.alignment = Alignment::kSim3});
  if (!evaluation) return;
  outcome.scale = evaluation->S_w_e.scale();
  outcome.ate_to_scale = evaluation->absolute.rmse;
}

Trajectory longest(const std::map<KeyframeId, Trajectory>& of_parts) {
  Trajectory found;
  for (const auto& [part, trajectory] : of_parts) {
    if (trajectory.size() > found.size()) found = trajectory;
  }
  return found;
}

/// What a run says of its poses while it goes on.
class PoseWatch {
 public:
  /// `relative`: lengths are comparable with the truth's.
  explicit PoseWatch(bool relative) : relative_(relative) {}

  void look_at(const PoseReport& report) {
    const FrameRecord& record = report.record;
    jitter_.add(record.t_ns);
    if (!relative_) return;
    if (record.state != FrameState::kTracked || !report.graph.contains(record.reference)) return;
    const std::int64_t t_ref_ns = report.graph.keyframe(record.reference).t_ns;
    if (t_ref_ns == record.t_ns) return;
    poses_.push_back(
        {record.frame_index, record.T_c_ref.unpacked(), record.t_ns, t_ref_ns, report.information.inverse()});
  }
  /// How far the recording's time stamps scatter.
  [[nodiscard]] double clock() const { return jitter_.sigma(); }
  [[nodiscard]] const std::vector<RelativePose>& poses() const { return poses_; }

 private:
  bool relative_;
  ClockJitter jitter_;
  std::vector<RelativePose> poses_;
};

/// The frames that the variation has, as it has them. `frames` outlives the feed.
FrameFeed feed_of(const std::vector<Frame>& frames, const Variation& variation) {
  return [&frames, &variation, next = static_cast<std::size_t>(variation.left_out)](Frame& frame) mutable {
    for (bool is_there = false; !is_there; next += static_cast<std::size_t>(variation.every)) {
      if (next >= frames.size()) return FrameStatus::kEnd;
      frame = frames[next];
      frame.index = static_cast<std::int64_t>(next);
      is_there = vary(frame, variation, 1e-9 * static_cast<double>(frame.t_ns - frames.front().t_ns));
    }
    return FrameStatus::kFrame;
  };
}

/// Of each map part, which have worlds of their own.
struct PartTrajectories {
  std::map<KeyframeId, Trajectory> final_ones, causal;
};

/// Counts the frames by the way.
PartTrajectories trajectories_of(const RunResult& result, Outcome& outcome) {
  PartTrajectories parts;
  for (const FrameRecord& record : result.frames) {
    ++outcome.frames;
    outcome.each.push_back({record});
    if (!has_final_pose(record) || !result.graph.contains(record.reference)) continue;
    parts.final_ones[result.graph.part(record.reference)].push_back(
        {record.t_ns, final_T_c_w(record, result.graph).inverse()});
    if (record.state == FrameState::kPlacedLater) continue;
    ++outcome.tracked;
    parts.causal[record.part_causal].push_back({record.t_ns, record.T_c_w_causal.unpacked().inverse()});
  }
  for (const auto& [part, estimate] : parts.final_ones) outcome.parts.push_back(estimate.size());
  std::sort(outcome.parts.rbegin(), outcome.parts.rend());
  return parts;
}

void judge_poses(const std::vector<RelativePose>& poses, const RelativeTruth& relative, Outcome& outcome) {
  for (const RelativePose& pose : poses) {
    const auto comparison = relative.compare(pose.T_c_ref, pose.t_c_ns, pose.t_ref_ns);
    if (!comparison) continue;
    const Vector6 variances = (pose.covariance + comparison->of_truth).diagonal();
    outcome.poses.push_back({pose.frame_index, pose.t_c_ns, pose.t_ref_ns, comparison->error,
                             variances.cwiseSqrt(), comparison->normalised(pose.covariance)});
  }
}

/// @param noise    of the truth; its clock is how far the recording's time stamps scatter
/// @param readout  of the cameras, where the source leaves it open [s]
Outcome run(const std::string& text, const SourceOptions& source_options, const Variation& variation,
            TruthNoise noise, std::optional<double> readout) {
  const std::unique_ptr<FrameSource> source = open_source(text, source_options);
  Rig rig = source->rig();
  if (!rig.readout) rig.readout = readout;
  std::vector<Frame> frames = read_all(*source);
  if (frames.empty()) throw std::runtime_error(text + ": no frames");
  const std::int64_t end_ns = frames.back().t_ns;
  frames = reordered(frames, variation.order, end_ns);
  const Trajectory truth = reordered(varied(source->ground_truth(), rig, variation), variation.order, end_ns);
  const bool to_scale = rig.kind != SensorKind::kMono;
  PoseWatch watch(to_scale);
  EngineOptions options;
  options.deterministic = true;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  options.on_pose = [&](const PoseReport& report) { watch.look_at(report); };
  const std::atomic<bool> interrupted{false};
  const RunResult result =
      Engine(varied(rig, variation), options).run(feed_of(frames, variation), interrupted);
  if (!result.error.empty()) throw std::runtime_error(text + ": " + result.error);
  Outcome outcome;
  const PartTrajectories parts = trajectories_of(result, outcome);
  outcome.clock = noise.clock = watch.clock();
  judge_poses(watch.poses(), RelativeTruth(truth, noise), outcome);
  const Alignment alignment = to_scale ? Alignment::kSe3 : Alignment::kSim3;
  judge_frames(parts.final_ones, result, truth, alignment, outcome.each);
  outcome.ate = ate(longest(parts.final_ones), truth, alignment);
  judge_scale(longest(parts.final_ones), truth, outcome);
  outcome.ate_causal = ate(longest(parts.causal), truth, alignment);
  return outcome;
}

void print_frames(const Outcome& outcome) {
  fmt::print("# frame, lost why | part, inliers, share of points found, keyframe, error m\n");
  for (const FrameOutcome& frame : outcome.each) {
    const FrameRecord& record = frame.record;
    if (!has_final_pose(record)) {
      fmt::print("{} lost: {}\n", record.frame_index, describe(record.cause));
    } else {
      fmt::print("{} {} {} {:.2f} {} {:.4f}\n", record.frame_index, frame.rank, record.inliers,
                 record.tracked_share, record.keyframe ? "K" : "-", frame.error);
    }
  }
}

void print_poses(const Outcome& outcome) {
  fmt::print("# frame, since reference s | NEES / 6 | error mm, mrad | standard deviations mm, mrad\n");
  for (const PoseError& pose : outcome.poses) {
    fmt::print("{} {:.3f} {:.2f}", pose.frame_index, 1e-9 * static_cast<double>(pose.t_c_ns - pose.t_ref_ns),
               pose.nees);
    for (const double error : pose.error) fmt::print(" {:.3f}", 1e3 * error);
    for (const double sigma : pose.sigma) fmt::print(" {:.3f}", 1e3 * sigma);
    fmt::print("\n");
  }
}

std::string nees_summary(const std::vector<PoseError>& poses) {
  if (poses.empty()) return "-";
  double mean = 0;
  std::vector<double> each;
  for (const PoseError& pose : poses) {
    each.push_back(pose.nees);
    mean += pose.nees / static_cast<double>(poses.size());
  }
  return fmt::format("{:.2f} / {:.2f} / {:.2f}", quantile(each, 0.5), mean, quantile(each, 0.95));
}

void print_row(const Variation& variation, const Outcome& outcome) {
  const auto metres = [](double ate) { return ate < 0 ? std::string("-") : fmt::format("{:.5f}", ate); };
  fmt::print("| {} | {}/{} | {} | {} | {} | {} | {:.5f} | {} |\n", variation.name, outcome.tracked,
             outcome.frames, fmt::join(outcome.parts, " + "), metres(outcome.ate), metres(outcome.ate_causal),
             nees_summary(outcome.poses), outcome.scale, metres(outcome.ate_to_scale));
  std::fflush(stdout);
}

std::vector<Variation> usual_ones() {
  return {{"as it is"},
          {"first frame left out", 1},
          {"first two left out", 2},
          {"first three left out", 3},
          {"noise of one grey level", 0, 1},
          {"gain 0.9", 0, 0, 0.9},
          {"the middle 90 %", 0, 0, 1, 0.9},
          {"three quarters of the size", 0, 0, 1, 1, 0.75},
          {"in a mirror", 0, 0, 1, 1, 1, true}};
}

std::vector<Variation> seldom_ones(const std::vector<int>& every) {
  std::vector<Variation> variations;
  for (const int n : every)
    variations.push_back({.name = fmt::format("frames 0, {}, {}, ..", n, 2 * n), .every = n});
  return variations;
}

std::vector<Variation> hard_ones() {
  std::vector<Variation> variations;
  for (const Hardship& hardship : hardships())
    variations.push_back({.name = hardship.name, .hardship = &hardship});
  return variations;
}

/// What the command line says.
struct Arguments {
  std::vector<std::string> sources;
  std::string calibration;
  std::string camera = "all";
  bool as_it_is_only = false, hard = false;
  bool frames = false, poses = false;
  Order order = Order::kForwards;
  int only = -1;
  std::vector<int> every;
  std::vector<double> truth{0, 0};
  std::optional<double> readout;
};

void add_options(CLI::App& app, Arguments& arguments) {
  app.add_option("source", arguments.sources, "as of 'twofold run'")->required();
  app.add_option("--calib", arguments.calibration, "calibration file for all of them");
  app.add_option("--camera", arguments.camera,
                 "mono: the left camera alone, errors after alignment with scale")
      ->check(CLI::IsMember({"all", "mono"}));
  app.add_flag("--only-as-it-is", arguments.as_it_is_only, "no variations");
  app.add_flag("--frames", arguments.frames, "what became of each frame");
  app.add_flag("--poses", arguments.poses, "each pose relative to its reference keyframe against the truth");
  CLI::Option* const one = app.add_option("--only", arguments.only, "this variation alone, counted from 0")
                               ->check(CLI::NonNegativeNumber);
  app.add_option("--order", arguments.order, "that frames are played in")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, Order>{{"forwards", Order::kForwards},
                                                               {"backwards", Order::kBackwards},
                                                               {"there-and-back", Order::kThereAndBack}}));
  CLI::Option* const seldom =
      app.add_option("--every", arguments.every,
                     "instead of the variations: every first, second, .. frame, as many as given")
          ->check(CLI::PositiveNumber)
          ->excludes(one);
  app.add_flag("--hard", arguments.hard, "instead of the variations: what real cameras do to a recording")
      ->excludes(seldom);
  app.add_option("--readout", arguments.readout,
                 "of the cameras, where the source leaves it open [s]; rendered: 0");
  app.add_option("--truth", arguments.truth, "standard deviations of the truth's own poses: METRES RADIANS")
      ->expected(2);
}

/// Those that are asked for.
std::vector<Variation> variations_of(const Arguments& arguments) {
  std::vector<Variation> variations = arguments.hard            ? hard_ones()
                                      : arguments.every.empty() ? usual_ones()
                                                                : seldom_ones(arguments.every);
  const auto count = static_cast<int>(variations.size());
  if (arguments.only >= count)
    throw std::invalid_argument(fmt::format("--only {}: the last one is {}", arguments.only, count - 1));
  if (arguments.only >= 0) variations = {variations[static_cast<std::size_t>(arguments.only)]};
  if (arguments.as_it_is_only) variations.resize(1);
  for (Variation& variation : variations) variation.order = arguments.order;
  return variations;
}

void run_all(const Arguments& arguments) {
  SourceOptions options;
  if (!arguments.calibration.empty()) options.calibration = arguments.calibration;
  options.left_only = arguments.camera == "mono";
  const TruthNoise noise{arguments.truth[0], arguments.truth[1]};
  const std::vector<Variation> variations = variations_of(arguments);
  for (const std::string& source : arguments.sources) {
    fmt::print(
        "\n| {} | tracked | in parts | ATE m | causal m | NEES / 6: median / mean / p95 "
        "| scale | ATE m to scale |\n|---|---|---|---|---|---|---|---|\n",
        source);
    for (const Variation& variation : variations) {
      const Outcome outcome = run(source, options, variation, noise, arguments.readout);
      print_row(variation, outcome);
      if (arguments.frames) print_frames(outcome);
      if (arguments.poses) print_poses(outcome);
    }
  }
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  twofold::Arguments arguments;
  CLI::App app("Runs of one recording that should differ by little");
  twofold::add_options(app, arguments);
  CLI11_PARSE(app, argc, argv);
  try {
    twofold::run_all(arguments);
  } catch (const std::exception& error) {
    fmt::print(stderr, "variations: {}\n", error.what());
    return 1;
  }
  return 0;
}
