#include "streams/pose_lines.hpp"

#include <iterator>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "evaluation/tum_line.hpp"

namespace twofold {
namespace {

template <class Numbers>
auto list(const Numbers& numbers) {
  return fmt::join(numbers, ",");
}

/// Zero has one sign: "-0" makes people look for a meaning.
Pose without_minus_zeros(Pose T) {
  for (double& number : T.q) number += 0.0;
  for (double& number : T.t) number += 0.0;
  return T;
}

void append_pose(std::string& line, const PoseEstimate& pose) {
  const auto out = std::back_inserter(line);
  const Pose T = without_minus_zeros(pose.T_world_camera);
  const Pose T_ref = without_minus_zeros(pose.T_reference_camera);
  fmt::format_to(out, R"(,"position":[{}],"orientation":[{}],"map_part":{},"reference_keyframe":{})",
                 list(T.t), list(T.q), pose.map_part, pose.reference_keyframe);
  fmt::format_to(out, R"(,"position_in_reference":[{}],"orientation_in_reference":[{}])", list(T_ref.t),
                 list(T_ref.q));
  const Pose T_odom = without_minus_zeros(pose.T_odom_camera);
  fmt::format_to(out, R"(,"position_in_odom":[{}],"orientation_in_odom":[{}])", list(T_odom.t),
                 list(T_odom.q));
  fmt::format_to(out, R"(,"velocity":[{:.6g}])", list(pose.velocity));
  if (pose.covariance_known)
    fmt::format_to(out, R"(,"covariance":[{:.6g}])", list(pose.covariance));
  else
    line += R"(,"covariance":null)";
}

std::string json_pose(const PoseEstimate& pose) {
  std::string line = fmt::format(R"({{"frame":{},"t_ns":{},"state":"{}","reason":"{}")", pose.frame,
                                 pose.t_ns, to_string(pose.state), pose.reason);
  if (pose.state == TrackingState::kTracked) append_pose(line, pose);
  fmt::format_to(std::back_inserter(line),
                 R"(,"keyframe":{},"points":{},"tracked_share":{:.4g},"effort":{},"map_version":{},)"
                 R"("exposed_ns":{},"latency_ns":{}}})"
                 "\n",
                 pose.keyframe, pose.points, pose.tracked_share, pose.effort, pose.map_version,
                 pose.exposed_ns, pose.latency_ns);
  return line;
}

std::string id_or_null(std::uint32_t id) {
  return id == kNoId ? "null" : std::to_string(id);
}

std::string json_event(const MapEvent& event) {
  const Pose before = without_minus_zeros(event.T_world_camera_before);
  const Pose after = without_minus_zeros(event.T_world_camera_after);
  return fmt::format(
      R"({{"event":"{}","frame":{},"t_ns":{},"map_version":{},"keyframe":{},"map_part_before":{},)"
      R"("map_part":{},"moved":{:.6g},"turned":{:.6g},"position_before":[{}],"orientation_before":[{}],)"
      R"("position":[{}],"orientation":[{}],"loop_from":{},"loop_to":{},"keyframes_moved":{},)"
      R"("farthest_moved":{:.6g},"most_turned":{:.6g}}})"
      "\n",
      to_string(event.kind), event.frame, event.t_ns, event.map_version, id_or_null(event.keyframe),
      id_or_null(event.map_part_before), id_or_null(event.map_part), event.moved, event.turned,
      list(before.t), list(before.q), list(after.t), list(after.q), id_or_null(event.loop_from),
      id_or_null(event.loop_to), event.keyframes_moved, event.farthest_moved, event.most_turned);
}

}  // namespace

std::string pose_line(const PoseEstimate& pose, PoseForm form) {
  if (form == PoseForm::kJson) return json_pose(pose);
  if (pose.state != TrackingState::kTracked) return "";
  const Pose T = without_minus_zeros(pose.T_world_camera);
  return fmt::format("{} {} {}\n", seconds_text(pose.t_ns), fmt::join(T.t, " "), fmt::join(T.q, " "));
}

std::string event_line(const MapEvent& event, PoseForm form) {
  if (form == PoseForm::kJson) return json_event(event);
  return fmt::format("# {} at frame {}: moved {:.4g} m, turned {:.4g} rad\n", to_string(event.kind),
                     event.frame, event.moved, event.turned);
}

std::string missed_line(std::uint64_t lines, PoseForm form) {
  return fmt::format(fmt::runtime(form == PoseForm::kJson ? "{{\"missed\":{}}}\n" : "# missed {} lines\n"),
                     lines);
}

std::string error_line(const std::string& why, PoseForm form) {
  return fmt::format(fmt::runtime(form == PoseForm::kJson ? "{{\"error\":\"{}\"}}\n" : "# error: {}\n"), why);
}

}  // namespace twofold
