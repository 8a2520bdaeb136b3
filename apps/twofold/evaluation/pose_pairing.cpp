#include "apps/twofold/evaluation/pose_pairing.hpp"

#include <filesystem>
#include <functional>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "evaluation/tum_line.hpp"
#include "io/files/io_error.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// Files of EuRoC's form have the body's poses.
Trajectory read_truth_of_body(const std::string& file) {
  if (auto of_camera = read_euroc_truth_of_camera(file)) return *std::move(of_camera);
  fmt::print(stderr,
             "twofold: {}: these are poses of the body, not of the camera, and no cam0/sensor.yaml beside it "
             "says how that sits in it: give groundtruth.txt of a run with --calib, or the recording's "
             "folder, instead\n",
             file);
  return read_trajectory(file);
}

bool has_form(const std::string& file, TrajectoryForm form) {
  return fs::is_regular_file(file) && trajectory_form(file) == form;
}

Trajectory read_truth(const std::string& text) {
  if (fs::is_regular_file(text))
    return has_form(text, TrajectoryForm::kEuroc) ? read_truth_of_body(text) : read_trajectory(text);
  const auto source = open_source(text);
  if (!source->ground_truth().empty()) return source->ground_truth();
  const std::vector<std::string> notes = source->report().notes;
  std::string message = "the recording has no ground truth";
  for (const std::string& note : notes) message += "; " + note;
  throw IoError(text, message);
}

/// Of a run that was killed, too.
Trajectory read_estimate(const std::string& file) {
  if (!has_form(file, TrajectoryForm::kTum)) return read_trajectory(file);
  std::string note;
  Trajectory estimate = read_tum_trajectory(file, {.cut = CutLine::kLeftOut}, &note);
  if (!note.empty()) fmt::print(stderr, "twofold: {}\n", note);
  return estimate;
}

/// What to give for a truth of KITTI's form, whose times are in another file.
std::string with_times_instead(const fs::path& poses) {
  const fs::path sequence =
      poses.parent_path().parent_path() / "sequences" / poses.stem();  // the benchmark's own layout
  std::error_code ignored;
  return fmt::format("give the folder of the sequence instead ({})",
                     fs::is_directory(sequence, ignored) ? sequence.string() : "with its times.txt");
}

/// A trajectory, or why its times can be none in the usual unit.
struct Reading {
  std::optional<Trajectory> trajectory;
  std::string error;
};

Reading read_if_possible(const std::function<Trajectory()>& read) {
  try {
    return {read(), {}};
  } catch (const IoError& error) {
    return {std::nullopt, error.what()};
  }
}

using Pair = std::function<std::vector<PosePair>(const Trajectory& estimate, const Trajectory& truth)>;
constexpr std::size_t kFew = 3;  // fewer cannot be aligned

/// How many true poses have a partner: in too small a unit all of an estimate is at the time of one.
std::size_t true_poses(const std::vector<PosePair>& pairs) {
  std::size_t count = pairs.empty() ? 0 : 1;
  for (std::size_t i = 1; i < pairs.size(); ++i)
    if (pairs[i].T_w_c.matrix() != pairs[i - 1].T_w_c.matrix()) ++count;
  return count;
}

/// The poses that find together when the times of one of the files, of TUM's form, are in another unit: in
/// that which finds partners for most true poses; nothing where these are hardly any.
std::optional<PosePairing> pair_in_other_unit(const std::string& file, const Trajectory& other,
                                              bool is_estimate, const Pair& pair) {
  if (!has_form(file, TrajectoryForm::kTum)) return std::nullopt;
  PosePairing best;
  const char* name = nullptr;
  for (const TimeUnit unit :
       {TimeUnit::kNanoseconds, TimeUnit::kMicroseconds, TimeUnit::kMilliseconds, TimeUnit::kSeconds}) {
    const Reading reading =
        read_if_possible([&] { return read_tum_trajectory(file, {.cut = CutLine::kLeftOut, .unit = unit}); });
    if (!reading.trajectory) continue;
    const Trajectory& estimate = is_estimate ? *reading.trajectory : other;
    auto pairs = pair(estimate, is_estimate ? other : *reading.trajectory);
    if (true_poses(pairs) < kFew || true_poses(pairs) <= true_poses(best.pairs)) continue;
    best = {std::move(pairs), estimate.size()};
    name = name_of(unit);
  }
  if (name == nullptr) return std::nullopt;
  fmt::print(stderr, "twofold: {}: time stamps are taken as {}, by which {} poses have a partner\n", file,
             name, best.pairs.size());
  return best;
}

std::string range_text(const std::string& file, const Trajectory& trajectory) {
  if (trajectory.empty()) return fmt::format("{} has no poses", file);
  return fmt::format("{} has {} from {} to {} s", file, trajectory.size(),
                     seconds_text(trajectory.front().t_ns), seconds_text(trajectory.back().t_ns));
}

PosePairing pair_by_time(const std::string& estimate_file, const std::string& truth_file,
                         std::int64_t max_difference_ns) {
  const auto [estimate, estimate_error] = read_if_possible([&] { return read_estimate(estimate_file); });
  const auto [truth, truth_error] = read_if_possible([&] { return read_truth(truth_file); });
  if (!estimate && !truth) throw IoError(estimate_error);
  const Pair pair = [&](const Trajectory& e, const Trajectory& t) {
    return associate(e, t, max_difference_ns);
  };
  PosePairing usual;
  if (estimate && truth) usual = {pair(*estimate, *truth), estimate->size()};
  if (true_poses(usual.pairs) >= kFew) return usual;
  std::optional<PosePairing> other;
  if (truth) other = pair_in_other_unit(estimate_file, *truth, true, pair);
  if (!other && estimate) other = pair_in_other_unit(truth_file, *estimate, false, pair);
  if (other) return *std::move(other);
  if (!estimate) throw IoError(estimate_error);
  if (!truth) throw IoError(truth_error);
  if (!usual.pairs.empty()) return usual;
  throw IoError(fmt::format(
      "no poses of the two trajectories are close in time, within {} s "
      "(--max-difference): {}; {}",
      seconds_text(max_difference_ns), range_text(estimate_file, *estimate), range_text(truth_file, *truth)));
}

PosePairing pair_by_line(const std::string& estimate_file, const std::string& truth_file) {
  const Trajectory estimate = read_trajectory(estimate_file), truth = read_trajectory(truth_file);
  if (estimate.size() != truth.size()) {
    throw IoError(estimate_file, fmt::format("has {} poses without time stamps, {} has {}", estimate.size(),
                                             truth_file, truth.size()));
  }
  return {associate(estimate, truth, 0), estimate.size(), false};
}

}  // namespace

PosePairing pair_poses(const std::string& estimate, const std::string& truth,
                       std::int64_t max_difference_ns) {
  if (fs::is_directory(estimate)) throw IoError(estimate, "is a folder: give its trajectory.txt");
  if (!fs::is_regular_file(estimate)) throw IoError(estimate, "no such trajectory file");
  const bool by_line = has_form(estimate, TrajectoryForm::kKitti);
  if (by_line == has_form(truth, TrajectoryForm::kKitti))
    return by_line ? pair_by_line(estimate, truth) : pair_by_time(estimate, truth, max_difference_ns);
  throw IoError(by_line ? estimate : truth,
                "has no time stamps (KITTI form), the other trajectory has: " +
                    (by_line ? "they cannot be brought together" : with_times_instead(truth)));
}

}  // namespace twofold
