#include "apps/twofold/view/finished_run.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <numeric>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/twofold/map_parts.hpp"
#include "apps/twofold/view/run_files.hpp"
#include "apps/twofold/view/run_frames.hpp"
#include "slam/conversions.hpp"
#include "viewer/truth.hpp"

namespace twofold {
namespace {

void copy_position(const Vector3& from, float (&to)[3]) {
  for (int i = 0; i < 3; ++i) to[i] = static_cast<float>(from[i]);
}

/// A pose of the run, and the part of the map whose world it is in.
struct PlacedPose {
  TimedPose pose;
  const RunPart* part = nullptr;
};

/// What is put together of a run's files.
class FinishedRun {
 public:
  explicit FinishedRun(const std::filesystem::path& folder)
      : summary_(read_run_json(folder / "summary.json")), parts_(read_run_parts(folder)) {
    for (const RunPart& part : parts_)
      for (const TimedPose& pose : part.poses) poses_.emplace(pose.t_ns, PlacedPose{pose, &part});
    for (const TimedPose& pose : read_tum_trajectory(folder / "trajectory_causal.txt"))
      causal_.emplace(pose.t_ns, pose.T_w_c.translation());
    find_frames(folder / "frames.txt");
    start_ns_ = frames_.front().t_ns;
  }

  [[nodiscard]] const RunJson& summary() const { return summary_; }
  [[nodiscard]] bool in_metres() const { return summary_.value("scale", "") != "arbitrary"; }
  void show(const std::filesystem::path& folder, ViewScene& scene, ViewTitle& title) const;

 private:
  void find_frames(const std::filesystem::path& file);
  [[nodiscard]] float seconds(std::int64_t t_ns) const {
    return static_cast<float>(1e-9 * static_cast<double>(t_ns - start_ns_));
  }
  [[nodiscard]] ViewMap map() const;
  [[nodiscard]] std::vector<ViewKeyframe> keyframes() const;
  [[nodiscard]] std::vector<MapSnapshot::Loop> loops() const;
  /// Keyframe at that time or before; kNoId: none, or none is meant.
  [[nodiscard]] std::uint32_t keyframe_at(const RunJson& loop, const char* t_ns, bool loaded = false) const;
  void place(const PlacedPose& placed, ViewPathFrame& frame) const;
  void add_path(ViewScene& scene) const;
  void add_truth(const std::filesystem::path& file, ViewScene& scene) const;
  void add_events(ViewScene& scene) const;
  [[nodiscard]] ViewEvent correction_of(const RunJson& correction) const;
  [[nodiscard]] ViewEvent relocalisation_of(const RunJson& placed) const;

  RunJson summary_;
  std::vector<RunPart> parts_;
  std::map<std::int64_t, PlacedPose> poses_;  // of all parts, by their times
  std::map<std::int64_t, Vector3> causal_;
  std::vector<RunFrame> frames_;
  std::int64_t start_ns_ = 0;
};

/// 0 where the summary has none, or null.
double number(const RunJson& entry, const char* key) {
  const auto value = entry.find(key);
  return value != entry.end() && value->is_number() ? value->get<double>() : 0.0;
}

/// Entries of one of the summary's lists by the numbers of their frames.
std::map<std::uint32_t, RunJson> by_frame(const RunJson& summary, const char* list) {
  std::map<std::uint32_t, RunJson> entries;
  for (const RunJson& entry : summary.value(list, RunJson::array())) {
    if (entry.is_object()) entries.emplace(entry.value("frame", kNoId), entry);
  }
  return entries;
}

void FinishedRun::find_frames(const std::filesystem::path& file) {
  if (std::filesystem::exists(file)) {
    frames_ = read_run_frames(file);
  } else {  // runs before there was such a file
    std::vector<std::uint32_t> lost, dropped;
    for (const auto& [number, entry] : by_frame(summary_, "why_lost")) lost.push_back(number);
    for (const auto& [number, entry] : by_frame(summary_, "why_late"))
      if (!entry.contains("latency_ms")) dropped.push_back(number);
    Trajectory poses;
    for (const auto& [t_ns, placed] : poses_) poses.push_back(placed.pose);
    frames_ = counted_frames(poses, lost, dropped);
  }
  if (frames_.empty()) throw IoError(file.string(), "holds no frame");
}

std::vector<ViewKeyframe> FinishedRun::keyframes() const {
  std::map<std::int64_t, std::uint32_t> numbers;
  for (const RunFrame& frame : frames_) numbers.emplace(frame.t_ns, frame.number);
  std::vector<ViewKeyframe> keyframes;
  for (const RunPart& part : parts_) {
    for (std::size_t k = 0; k < part.keyframes.size(); ++k) {
      const TimedPose& pose = part.keyframes[k];
      ViewKeyframe& keyframe = keyframes.emplace_back();
      keyframe.id = part.ids[k];
      keyframe.part = part.name();
      if (k >= part.loaded) {  // others were there from the first moment on
        keyframe.t = seconds(pose.t_ns);
        const auto number = numbers.find(pose.t_ns);
        keyframe.frame = number != numbers.end() ? number->second : 0;
      }
      copy_position(pose.T_w_c.translation(), keyframe.position);
      for (int i = 0; i < 4; ++i)
        keyframe.orientation[i] = static_cast<float>(pose.T_w_c.so3().quaternion().coeffs()[i]);
    }
  }
  std::sort(keyframes.begin(), keyframes.end(),
            [](const ViewKeyframe& a, const ViewKeyframe& b) { return a.id < b.id; });
  return keyframes;
}

ViewMap FinishedRun::map() const {
  ViewMap map;
  map.version = 1;
  map.keyframes = keyframes();
  for (const RunPart& part : parts_) {
    for (const PlyPoint& from : part.points) {
      ViewPoint& point = map.points.emplace_back();
      point.id = static_cast<std::uint32_t>(map.points.size() - 1);
      copy_position(from.x_w, point.position);
      point.part = part.name();
      point.anchor = from.first_keyframe < part.ids.size() ? part.ids[from.first_keyframe] : 0;
      point.observers = static_cast<std::uint8_t>(std::min<std::uint32_t>(from.observers, 255));
      point.deviation = deviation_code(from.stddev);
    }
    map.edges.insert(map.edges.end(), part.edges.begin(), part.edges.end());
  }
  std::sort(map.edges.begin(), map.edges.end(),
            [](const ViewEdge& a, const ViewEdge& b) { return a.key() < b.key(); });
  mark_loops(loops(), map);
  return map;
}

std::uint32_t FinishedRun::keyframe_at(const RunJson& loop, const char* t_ns, bool loaded) const {
  const auto value = loop.find(t_ns);
  if (value == loop.end() || !value->is_number_integer()) return kNoId;
  std::pair<std::int64_t, std::uint32_t> newest{std::numeric_limits<std::int64_t>::min(), kNoId};
  for (const RunPart& part : parts_) {
    const std::size_t end = loaded ? part.loaded : part.keyframes.size();
    for (std::size_t k = loaded ? 0 : part.loaded; k < end; ++k)
      if (part.keyframes[k].t_ns <= value->get<std::int64_t>())
        newest = std::max(newest, {part.keyframes[k].t_ns, part.ids[k]});
  }
  return newest.second;
}

std::vector<MapSnapshot::Loop> FinishedRun::loops() const {
  std::vector<MapSnapshot::Loop> loops;
  for (const RunJson& from : summary_.value("closed_loops", RunJson::array())) {
    MapSnapshot::Loop& loop = loops.emplace_back();
    loop.t_ns = from.value("t_ns", start_ns_);
    // The page numbers the keyframes that are left, the run numbered all.
    loop.from = keyframe_at(from, "from_t_ns", from.value("from_loaded", false));
    loop.to = keyframe_at(from, "t_ns");
    loop.inliers = from.value("inliers", 0);
    loop.scale = from.value("scale", 1.0);
    loop.joins_parts = from.value("joins_parts", false);
    loop.drift = number(from, "drift_m");
    loop.turned = number(from, "drift_rad");
    loop.travelled = number(from, "travelled_m");
  }
  return loops;
}

/// Hangs the frame on the keyframe before it, or, if the run has none, on the loaded map's first.
void FinishedRun::place(const PlacedPose& placed, ViewPathFrame& frame) const {
  const auto& [pose, part] = placed;
  frame.part = part->name();
  const auto causal = causal_.find(pose.t_ns);
  copy_position(causal == causal_.end() ? pose.T_w_c.translation() : causal->second, frame.causal);
  if (part->keyframes.empty()) return;
  const auto own = part->keyframes.begin() + static_cast<std::ptrdiff_t>(part->loaded);
  const auto after = std::upper_bound(own, part->keyframes.end(), pose.t_ns,
                                      [](std::int64_t t_ns, const TimedPose& k) { return t_ns < k.t_ns; });
  const auto first = own == part->keyframes.end() ? part->keyframes.begin() : own;
  const auto reference = after == own ? first : std::prev(after);
  frame.reference = part->ids[static_cast<std::size_t>(reference - part->keyframes.begin())];
  frame.keyframe = reference >= own && reference->t_ns == pose.t_ns ? 1 : 0;
  set_pose_in_reference(to_pose(reference->T_w_c.inverse() * pose.T_w_c), frame);
}

void FinishedRun::add_path(ViewScene& scene) const {
  const auto lost = by_frame(summary_, "why_lost");
  const auto late = by_frame(summary_, "why_late");
  for (const RunFrame& from : frames_) {
    ViewPathFrame frame;
    frame.frame = from.number;
    frame.t = seconds(from.t_ns);
    frame.reference = frame.part = kNoId;
    frame.effort = from.effort;
    frame.latency_ms = from.latency_ms;
    frame.tracking_ms = from.tracking_ms;
    const auto placed = poses_.find(from.t_ns);
    if (placed != poses_.end()) {
      place(placed->second, frame);
    } else {
      frame.state =
          from.state == FrameState::kDropped ? kViewDropped : static_cast<std::uint8_t>(TrackingState::kLost);
    }
    for (const auto* list : {&lost, &late}) {
      const auto entry = list->find(from.number);
      if (entry == list->end()) continue;
      frame.reason = scene.reason_number(entry->second.value("cause", "").c_str());
      frame.latency_ms = entry->second.value("latency_ms", frame.latency_ms);
    }
    scene.add(frame);
  }
}

/// The path that the source knew, if it did.
void FinishedRun::add_truth(const std::filesystem::path& file, ViewScene& scene) const {
  if (!std::filesystem::exists(file)) return;
  std::vector<Pose> truth;
  std::vector<std::int64_t> t_ns;
  for (const TimedPose& pose : read_tum_trajectory(file)) {
    truth.push_back(to_pose(pose.T_w_c));
    t_ns.push_back(pose.t_ns);
  }
  TruthBeside beside(std::move(truth), std::move(t_ns), !in_metres());
  for (const auto& [time, placed] : poses_)
    if (auto path = beside.add({time, to_pose(placed.pose.T_w_c), placed.part->name()}))
      scene.set_truth(std::move(*path));
}

std::string kind_of(const std::string& reason) {
  if (reason == describe(CorrectionReason::kPoseGraph)) return to_string(MapEventKind::kPoseGraph);
  if (reason == describe(CorrectionReason::kPartsJoined)) return to_string(MapEventKind::kPartsJoined);
  return reason;
}

ViewEvent FinishedRun::correction_of(const RunJson& correction) const {
  ViewEvent event;
  event.kind = kind_of(correction.value("reason", ""));
  const std::int64_t t_ns = correction.value("t_ns", std::int64_t{0});
  event.t = seconds(t_ns);
  event.frame = correction.value("frame", 0U);
  event.moved = number(correction, "moved_m");
  event.turned = number(correction, "turned_rad");
  if (const auto at = poses_.lower_bound(t_ns); at != poses_.end()) {
    event.before = event.after = to_pose(at->second.pose.T_w_c).t;
    event.part = event.part_before = at->second.part->name();
  }
  return event;
}

/// Parts are those of the final map: one that was new may have joined another since.
ViewEvent FinishedRun::relocalisation_of(const RunJson& placed) const {
  ViewEvent event;
  const bool new_part = placed.value("new_part", false);
  event.kind = to_string(new_part ? MapEventKind::kNewPart : MapEventKind::kRelocalisation);
  const std::int64_t t_ns = placed.value("t_ns", std::int64_t{0});
  event.t = seconds(t_ns);
  event.frame = placed.value("frame", 0U);
  event.moved = number(placed, "moved_m");
  event.turned = number(placed, "turned_rad");
  const auto at = poses_.lower_bound(t_ns);
  if (at == poses_.end()) return event;
  event.before = event.after = to_pose(at->second.pose.T_w_c).t;
  event.part = at->second.part->name();
  if (at == poses_.begin()) return event;
  event.part_before = std::prev(at)->second.part->name();
  if (event.part == event.part_before) event.before = to_pose(std::prev(at)->second.pose.T_w_c).t;
  if (event.part == event.part_before && new_part) event.text = "a part that has joined this one since";
  return event;
}

void FinishedRun::add_events(ViewScene& scene) const {
  for (const RunJson& correction : summary_.value("pose_corrections", RunJson::array()))
    scene.add(correction_of(correction));
  for (const RunJson& placed : summary_.value("relocalisations", RunJson::array()))
    scene.add(relocalisation_of(placed));
  scene.add_loops(loops());
}

void FinishedRun::show(const std::filesystem::path& folder, ViewScene& scene, ViewTitle& title) const {
  scene.begin(start_ns_);
  title.kind = ViewKind::kFinished;
  title.metres = in_metres();
  const auto any_point = [this](const auto& has) {
    return std::any_of(parts_.begin(), parts_.end(), [&](const RunPart& part) {
      return std::any_of(part.points.begin(), part.points.end(), has);
    });
  };
  title.has_deviations = any_point([](const PlyPoint& point) { return point.stddev > 0; });
  title.has_observers = any_point([](const PlyPoint& point) { return point.observers > 0; });
  title.has_first_seen = any_point([](const PlyPoint& point) { return point.first_keyframe != kNoId; });
  title.has_times = std::any_of(frames_.begin(), frames_.end(),
                                [](const RunFrame& frame) { return frame.tracking_ms > 0; });
  add_truth(folder / "groundtruth.txt", scene);
  add_path(scene);
  scene.show(map());
  add_events(scene);
}

}  // namespace

void show_finished_run(const std::filesystem::path& folder, ViewScene& scene, ViewTitle& title) {
  try {
    const FinishedRun run(folder);
    title.title = fmt::format("{} ({})", folder.filename().string(), run.summary().value("source", ""));
    run.show(folder, scene, title);
  } catch (const RunJson::exception& error) {  // a number where a word should be
    throw IoError((folder / "summary.json").string(), std::string("makes no sense: ") + error.what());
  }
}

}  // namespace twofold
