#include "apps/twofold/finished_run.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/twofold/live_view.hpp"
#include "apps/twofold/map_options.hpp"
#include "io/files/io_error.hpp"
#include "io/files/ply.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/recorded_images.hpp"
#include "slam/conversions.hpp"
#include "slam/map_snapshot.hpp"
#include "viewer/truth.hpp"

namespace twofold {
namespace {

using Json = nlohmann::json;

float seconds(std::int64_t t_ns, std::int64_t start_ns) {
  return static_cast<float>(1e-9 * static_cast<double>(t_ns - start_ns));
}

void copy_position(const Vector3& from, float (&to)[3]) {
  for (int i = 0; i < 3; ++i) to[i] = static_cast<float>(from[i]);
}

std::vector<ViewKeyframe> keyframes_of(const Trajectory& poses, std::int64_t start_ns) {
  std::vector<ViewKeyframe> keyframes;
  for (const TimedPose& pose : poses) {
    ViewKeyframe& keyframe = keyframes.emplace_back();
    keyframe.id = static_cast<std::uint32_t>(keyframes.size() - 1);
    keyframe.t = seconds(pose.t_ns, start_ns);
    copy_position(pose.T_w_c.translation(), keyframe.position);
    for (int i = 0; i < 4; ++i)
      keyframe.orientation[i] = static_cast<float>(pose.T_w_c.so3().quaternion().coeffs()[i]);
  }
  return keyframes;
}

std::vector<ViewPoint> points_of(const std::vector<PlyPoint>& from) {
  std::vector<ViewPoint> points;
  for (const PlyPoint& p : from) {
    ViewPoint& point = points.emplace_back();
    point.id = static_cast<std::uint32_t>(points.size() - 1);
    copy_position(p.x_w, point.position);
    point.deviation = deviation_code(p.stddev);
  }
  return points;
}

/// Lines of edges.txt (graph_export.hpp).
std::vector<ViewEdge> read_edges(const std::filesystem::path& file, std::size_t keyframes) {
  std::vector<ViewEdge> edges;
  std::ifstream in(file);  // runs before there were such files have none
  ViewEdge edge;
  std::string kind;
  while (in >> edge.from >> edge.to >> edge.shared_points >> kind) {
    if (edge.from >= keyframes || edge.to >= keyframes)
      throw IoError(file.string(), "names a keyframe there is not");
    edge.marginalised = kind == "marginalised" ? 1 : 0;
    edges.push_back(edge);
  }
  std::sort(edges.begin(), edges.end(),
            [](const ViewEdge& a, const ViewEdge& b) { return a.key() < b.key(); });
  return edges;
}

/// The path that the source knew, if it did.
void add_truth(const std::filesystem::path& file, const Trajectory& poses, bool scaled, ViewScene& scene) {
  if (!std::filesystem::exists(file)) return;
  std::vector<Pose> truth;
  std::vector<std::int64_t> t_ns;
  for (const TimedPose& pose : read_tum_trajectory(file)) {
    truth.push_back(to_pose(pose.T_w_c));
    t_ns.push_back(pose.t_ns);
  }
  TruthBeside beside(std::move(truth), std::move(t_ns), scaled);
  for (const TimedPose& tracked : poses)
    if (auto path = beside.add({tracked.t_ns, to_pose(tracked.T_w_c), 0})) scene.set_truth(std::move(*path));
}

/// Frames of a finished run hang on the keyframe before them.
class PathBuilder {
 public:
  PathBuilder(const Trajectory& keyframes, const Trajectory& causal, std::int64_t start_ns)
      : keyframes_(keyframes), start_ns_(start_ns) {
    for (const TimedPose& pose : causal) causal_.emplace(pose.t_ns, pose.T_w_c.translation());
  }

  [[nodiscard]] ViewPathFrame tracked(std::uint32_t number, const TimedPose& pose) const {
    ViewPathFrame frame;
    frame.frame = number;
    frame.t = seconds(pose.t_ns, start_ns_);
    const auto causal = causal_.find(pose.t_ns);
    copy_position(causal == causal_.end() ? pose.T_w_c.translation() : causal->second, frame.causal);
    frame.reference = kNoId;
    const auto after = std::upper_bound(keyframes_.begin(), keyframes_.end(), pose.t_ns,
                                        [](std::int64_t t_ns, const TimedPose& k) { return t_ns < k.t_ns; });
    if (keyframes_.empty()) return frame;
    const auto reference = after == keyframes_.begin() ? after : std::prev(after);
    frame.reference = static_cast<std::uint32_t>(reference - keyframes_.begin());
    frame.keyframe = reference->t_ns == pose.t_ns ? 1 : 0;
    set_pose_in_reference(to_pose(reference->T_w_c.inverse() * pose.T_w_c), frame);
    return frame;
  }

 private:
  const Trajectory& keyframes_;
  std::int64_t start_ns_;
  std::map<std::int64_t, Vector3> causal_;
};

Json read_json(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw IoError(file.string(), "is missing: is this the output folder of a run?");
  Json json = Json::parse(in, nullptr, false);
  if (json.is_discarded()) throw IoError(file.string(), "is no JSON");
  return json;
}

/// Entries of one of the summary's lists by the numbers of their frames.
std::map<std::int64_t, Json> by_frame(const Json& summary, const char* list) {
  std::map<std::int64_t, Json> entries;
  for (const Json& entry : summary.value(list, Json::array()))
    entries.emplace(entry.value("frame", -1), entry);
  return entries;
}

/// Frames in the order of their numbers: the summary says which were lost, why, and how long after the one
/// before; and which were late, or dropped. Keyframes get their frames' numbers.
void add_path(const Trajectory& poses, const PathBuilder& builder, const Json& summary,
              std::vector<ViewKeyframe>& keyframes, ViewScene& scene) {
  const auto lost = by_frame(summary, "why_lost");
  const auto late = by_frame(summary, "why_late");
  const auto was_dropped = [&late](std::uint32_t number) {
    const auto entry = late.find(number);
    return entry != late.end() && !entry->second.contains("latency_ms");
  };
  std::uint32_t number = 0;
  float t = 0;
  for (const TimedPose& pose : poses) {
    for (;; ++number) {
      if (was_dropped(number)) continue;
      const auto entry = lost.find(number);
      if (entry == lost.end()) break;
      ViewPathFrame frame;
      frame.frame = number;
      frame.t = t += static_cast<float>(1e-3 * entry->second.value("ms_since_previous", 0.0));
      frame.reference = frame.part = kNoId;
      frame.state = static_cast<std::uint8_t>(TrackingState::kLost);
      frame.reason = scene.reason_number(entry->second.value("cause", "").c_str());
      scene.add(frame);
    }
    ViewPathFrame frame = builder.tracked(number++, pose);
    if (const auto entry = late.find(frame.frame); entry != late.end()) {
      frame.latency_ms = entry->second.value("latency_ms", 0.0F);
      frame.reason = scene.reason_number(entry->second.value("cause", "").c_str());
    }
    t = frame.t;
    if (frame.keyframe != 0) keyframes[frame.reference].frame = frame.frame;
    scene.add(frame);
  }
}

std::string kind_of(const std::string& reason) {
  if (reason == describe(CorrectionReason::kPoseGraph)) return to_string(MapEventKind::kPoseGraph);
  if (reason == describe(CorrectionReason::kPartsJoined)) return to_string(MapEventKind::kPartsJoined);
  return reason;
}

void add_events(const Json& summary, const Trajectory& poses, std::int64_t start_ns, ViewScene& scene) {
  for (const Json& correction : summary.value("pose_corrections", Json::array())) {
    ViewEvent event;
    event.kind = kind_of(correction.value("reason", ""));
    const std::int64_t t_ns = correction.value("t_ns", std::int64_t{0});
    event.t = seconds(t_ns, start_ns);
    event.frame = correction.value("frame", 0U);
    event.part = event.part_before = 0;
    event.moved = correction.value("moved_m", 0.0);
    event.turned = correction.value("turned_rad", 0.0);
    const auto at = std::lower_bound(poses.begin(), poses.end(), t_ns,
                                     [](const TimedPose& pose, std::int64_t t) { return pose.t_ns < t; });
    if (at != poses.end()) event.before = event.after = to_pose(at->T_w_c).t;
    scene.add(std::move(event));
  }
}

void add_loops(const Json& summary, const Trajectory& keyframes, std::int64_t start_ns, ViewScene& scene) {
  std::vector<MapSnapshot::Loop> loops;
  for (const Json& from : summary.value("closed_loops", Json::array())) {
    MapSnapshot::Loop& loop = loops.emplace_back();
    loop.t_ns = from.value("t_ns", start_ns);
    const auto number = [&from](const char* key) {  // null where there is none
      const auto value = from.find(key);
      return value != from.end() && value->is_number() ? value->get<double>() : 0.0;
    };
    loop.inliers = from.value("inliers", 0);
    loop.scale = from.value("scale", 1.0);
    loop.joins_parts = from.value("joins_parts", false);
    loop.drift = number("drift_m");
    loop.turned = number("drift_rad");
    loop.travelled = number("travelled_m");
    // The page numbers the keyframes that are left, the run numbered all.
    const auto to = std::lower_bound(keyframes.begin(), keyframes.end(), loop.t_ns,
                                     [](const TimedPose& k, std::int64_t t_ns) { return k.t_ns < t_ns; });
    if (to != keyframes.end() && to->t_ns == loop.t_ns)
      loop.to = static_cast<std::uint32_t>(to - keyframes.begin());
  }
  scene.add_loops(loops);
}

/// Of the run's recording, or of the one that it was made of.
RecordedImages recorded_images(const Json& summary) {
  const Json recording = summary.value("recording", Json());
  if (recording.is_string()) return images_of_recording("euroc:" + recording.get<std::string>(), {});
  return images_of_recording(summary.value("source", ""), {});
}

}  // namespace

KeyframeImages::Find images_of_run(const std::filesystem::path& folder) {
  try {
    const RecordedImages images = recorded_images(read_json(folder / "summary.json"));
    if (!images) return {};
    return [images, keyframes = read_tum_trajectory(folder / "keyframes.txt")](std::uint32_t keyframe) {
      return keyframe < keyframes.size() ? viewed_image(images(keyframes[keyframe].t_ns)) : ViewedImage();
    };
  } catch (
      const std::runtime_error&) {  // moved, deleted, or in need of a calibration that only the run was given
    return {};
  }
}

void show_finished_run(const std::filesystem::path& folder, ViewScene& scene, ViewTitle& title) {
  const Json summary = read_json(folder / "summary.json");
  const Trajectory poses = read_tum_trajectory(folder / "trajectory.txt");
  const Trajectory keyframes = read_tum_trajectory(folder / "keyframes.txt");
  if (poses.empty()) throw IoError((folder / "trajectory.txt").string(), "holds no pose");
  const std::int64_t start_ns = poses.front().t_ns;
  scene.begin(start_ns);
  title.kind = ViewKind::kFinished;
  title.title = fmt::format("{} ({})", folder.filename().string(), summary.value("source", ""));
  add_truth(folder / "groundtruth.txt", poses, summary.value("scale", "") == "arbitrary", scene);
  const PathBuilder builder(keyframes, read_tum_trajectory(folder / "trajectory_causal.txt"), start_ns);
  std::vector<ViewKeyframe> shown = keyframes_of(keyframes, start_ns);
  add_path(poses, builder, summary, shown, scene);
  scene.show({1, points_of(read_ply(folder / "map.ply")), std::move(shown),
              read_edges(folder / "edges.txt", keyframes.size())});
  add_events(summary, poses, start_ns, scene);
  add_loops(summary, keyframes, start_ns, scene);
}

void show_map_file(const std::filesystem::path& file, ViewScene& scene, ViewTitle& title) {
  constexpr std::size_t kFewPoints = 300'000;  // more would take seconds to find the covariances of
  SavedMap saved = open_map(file.string());
  auto version = std::make_shared<MapVersion>();
  version->graph = std::move(saved.graph);
  version->places = std::move(saved.places);
  title.rig = to_camera_rig(saved.rig);
  title.kind = ViewKind::kMap;
  title.title = file.filename().string();
  title.has_deviations = version->graph.point_count() < kFewPoints;
  const MapSnapshot map(std::make_shared<const MapSnapshot::Impl>(MapSnapshot::Impl{saved.rig, version}));
  std::int64_t start_ns = 0;
  if (const auto keyframes = map.keyframes(); !keyframes.empty()) start_ns = keyframes.front().t_ns;
  scene.begin(start_ns);
  const ViewMap view = view_of(map, start_ns, title.has_deviations);
  scene.show(view);
  for (std::uint32_t n = 0; const ViewKeyframe& keyframe : view.keyframes) {
    ViewPathFrame frame;
    frame.frame = n++;
    frame.t = keyframe.t;
    frame.reference = keyframe.id;
    frame.part = keyframe.part;
    frame.keyframe = 1;
    std::copy_n(keyframe.position, 3, frame.causal);
    scene.add(frame);
  }
}

}  // namespace twofold
