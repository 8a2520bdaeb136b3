#include "bench/places/kidnap_trial.hpp"

#include <atomic>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "graph/part_extraction.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "synthetic/random.hpp"
#include "synthetic/scenes.hpp"

namespace twofold::bench {
namespace {

constexpr double kCover = 2;         // [s]
constexpr double kLeastCarried = 4;  // [s] of walk
constexpr double kDegrees = 180 / std::numbers::pi;

/// True pose of the first frame's camera relative to frame i's, less the estimated one.
SE3 error_of(const FrameRecord& record, const RunResult& result, const SE3& T_c_first_true) {
  const SE3 T_first_w = final_T_c_w(result.frames.front(), result.graph);
  const SE3 T_c_first = final_T_c_w(record, result.graph) * T_first_w.inverse();
  return T_c_first.inverse() * T_c_first_true;
}

bool in_old_map(const FrameRecord& record, const GraphSnapshot& graph) {
  return graph.part(record.reference) == oldest_part(graph);
}

}  // namespace

Kidnapping draw_kidnapping(std::uint64_t trial, double round_seconds, bool to_unmapped_place) {
  const auto draw = [&](std::uint64_t which) {
    return synthetic::unit_interval(synthetic::counter_hash(7919, trial, which));
  };
  Kidnapping kidnapping;
  kidnapping.cover_at = (0.5 + 0.45 * draw(0)) * round_seconds;
  kidnapping.carried_to = round_seconds + 0.5 + draw(1) * (kidnapping.cover_at - kLeastCarried - 0.5);
  if (to_unmapped_place) kidnapping.elsewhere = 1000 + trial;
  return kidnapping;
}

KidnapTrials::KidnapTrials(const KidnapOptions& options) : options_(options) {
  synthetic::SyntheticOptions one_round = scene_options();
  one_round.rounds = 1;
  const synthetic::SyntheticSequence sequence(one_round);
  walk_.resize(static_cast<std::size_t>(sequence.frame_count()));
  round_seconds_ = sequence.frame_count() / options.fps;
  engine_.deterministic = true;
  engine_.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
}

synthetic::SyntheticOptions KidnapTrials::scene_options() const {
  synthetic::SyntheticOptions scene = synthetic::default_options(options_.scene);
  scene.f *= static_cast<double>(options_.width) / scene.width;
  scene.width = options_.width;
  scene.height = options_.width * 3 / 4;
  scene.fps = options_.fps;
  scene.noise = options_.noise;
  return scene;
}

Frame KidnapTrials::frame(const synthetic::SyntheticSequence& sequence, int i, bool before) {
  if (!before) return sequence.render(i);
  Frame& kept = walk_.at(static_cast<std::size_t>(i));
  if (kept.left.empty()) kept = sequence.render(i);
  return kept;
}

KidnapOutcome KidnapTrials::run(const Kidnapping& kidnapping) {
  synthetic::SyntheticOptions scene = scene_options();
  scene.cover_at = kidnapping.cover_at;
  scene.cover = kCover;
  scene.carried_to = kidnapping.carried_to;
  scene.elsewhere = kidnapping.elsewhere;
  scene.frames = static_cast<int>((kidnapping.cover_at + kCover + options_.watched_s) * options_.fps);
  const synthetic::SyntheticSequence sequence(scene);

  const auto seconds = [&](int i) { return i / options_.fps; };
  const FrameFeed feed = [&, next = 0](Frame& out) mutable {
    if (next == sequence.frame_count()) return FrameStatus::kEnd;
    out = frame(sequence, next, seconds(next) < kidnapping.cover_at);
    ++next;
    return FrameStatus::kFrame;
  };
  std::atomic<bool> interrupted{false};
  const RunResult result = Engine(sequence.rig(), engine_).run(feed, interrupted);
  if (!result.error.empty()) throw std::runtime_error(result.error);

  KidnapOutcome outcome;
  int first_seen = -1;
  for (const FrameRecord& record : result.frames) {
    const auto i = static_cast<int>(record.frame_index);
    if (sequence.covered(i)) continue;
    const bool after = seconds(i) > kidnapping.cover_at;
    if (after && first_seen < 0) first_seen = i;
    outcome.frames_watched += after ? 1 : 0;
    if (record.state != FrameState::kTracked || !in_old_map(record, result.graph)) continue;
    const SE3 error = error_of(record, result, sequence.T_w_c(i).inverse() * sequence.T_w_c(0));
    const double metres = error.translation().norm();
    if (!after) {
      outcome.error_before_m = metres;
      continue;
    }
    if (outcome.frames_in_old_map++ == 0) outcome.seconds = seconds(i - first_seen);
    outcome.worst_error_m = std::max(outcome.worst_error_m, metres);
    outcome.worst_error_deg = std::max(outcome.worst_error_deg, error.so3().log().norm() * kDegrees);
  }
  return outcome;
}

}  // namespace twofold::bench
