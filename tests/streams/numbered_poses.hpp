#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "streams/pose_lines.hpp"

namespace twofold::testing {

inline PoseEstimate numbered_pose(std::int64_t frame) {
  PoseEstimate pose;
  pose.frame = frame;
  pose.t_ns = 1'000'000'000 + frame;
  pose.state = TrackingState::kTracked;
  pose.T_world_camera.t = {static_cast<double>(frame), 0.25, -1};
  pose.map_part = 0;
  pose.reference_keyframe = 2;
  return pose;
}

/// What a reader of JSON lines knows in the end.
struct Heard {
  std::vector<std::int64_t> frames;
  std::int64_t missed = 0;

  /// Whole lines only: anything else fails to parse and throws.
  void take(const std::string& lines) {
    for (std::size_t begin = 0; begin < lines.size();) {
      const std::size_t end = lines.find('\n', begin);
      const auto line = nlohmann::json::parse(lines.substr(begin, end - begin));
      if (line.contains("missed")) {
        missed += line["missed"].get<std::int64_t>();
      } else {
        frames.push_back(line["frame"]);
      }
      begin = end == std::string::npos ? lines.size() : end + 1;
    }
  }
};

}  // namespace twofold::testing
