#pragma once

#include "viewer/scene.hpp"

namespace twofold::testing {

/// Keyframes at x = 0, 1, 2, ... that look along z; a point before each.
inline ViewMap small_map(std::uint32_t keyframes, std::uint64_t version = 1) {
  ViewMap map;
  map.version = version;
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    ViewKeyframe keyframe{.id = k, .frame = 10 * k, .t = 0.5F * static_cast<float>(k)};
    keyframe.position[0] = static_cast<float>(k);
    keyframe.window = k + 1 == keyframes ? 1 : 2;
    keyframe.points = 7;
    map.keyframes.push_back(keyframe);
    map.points.push_back(
        {.id = 3 * k, .position = {static_cast<float>(k), 0.25F, 4}, .anchor = k, .observers = 2});
    if (k > 0) map.edges.push_back({.from = k - 1, .to = k, .shared_points = 12, .marginalised = k % 2 == 0});
  }
  return map;
}

/// A frame tracked against a keyframe of that map, `z` before it.
inline PoseEstimate tracked_pose(std::int64_t frame, std::uint32_t reference, double z = 0.125) {
  PoseEstimate pose;
  pose.frame = frame;
  pose.t_ns = 1'000'000'000 + frame * 50'000'000;
  pose.state = TrackingState::kTracked;
  pose.T_world_camera.t = {static_cast<double>(reference), 0, z};
  pose.T_reference_camera.t = {0, 0, z};
  pose.map_part = 0;
  pose.reference_keyframe = reference;
  pose.points = 90;
  pose.tracked_share = 0.75;
  pose.latency_ns = 12'500'000;
  pose.map_version = 1;
  return pose;
}

}  // namespace twofold::testing
