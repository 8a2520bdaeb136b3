#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "twofold/types.hpp"

namespace twofold {

enum class TrackingState : std::uint8_t {
  kTracked,  ///< the pose is known
  kLost,     ///< looked at, no trustworthy pose
  kUnplaced  ///< lost since the start, in a loaded map of which no place was recognised yet
};
[[nodiscard]] TWOFOLD_API const char* to_string(TrackingState state);

inline constexpr std::uint32_t kNoId = 0xffffffffU;

/// PoseEstimate::covariance of which nothing is known: whoever takes it for a number notices.
[[nodiscard]] constexpr std::array<double, 36> unknown_covariance() {
  std::array<double, 36> covariance{};
  covariance.fill(std::numeric_limits<double>::quiet_NaN());
  return covariance;
}

/// What is known of the camera at one frame. Trivially copyable.
struct PoseEstimate {
  std::int64_t frame = 0;  ///< counts pushed frames from 0, dropped ones included
  std::int64_t t_ns = 0;   ///< the frame's own time
  TrackingState state = TrackingState::kLost;
  bool keyframe = false;  ///< proposed as a keyframe of the map
  bool covariance_known = false;
  std::uint8_t effort = 0;   ///< effort level, 0: nothing left out (docs/architecture.md)
  const char* reason = "";   ///< why it is lost, in words; a string that lives as long as the program
  std::int32_t points = 0;   ///< measurements the pose rests on
  double tracked_share = 0;  ///< those over the points looked for, in [0, 1]

  // Of tracked frames only:
  /// Of the left camera as the frames show it: rectified ones are turned against the lens that took them
  /// (FrameRectifier::T_rectified_raw). In the world of `map_part`, as version `map_version` of the map has
  /// it.
  Pose T_world_camera;
  /// Id of the map part; each has a world frame of its own. It is the id of the part's first keyframe, which
  /// may have been culled since. Parts that join share one id, so keyframes with smaller ids may belong to
  /// it.
  std::uint32_t map_part = kNoId;
  std::uint32_t reference_keyframe = kNoId;
  /// Relative to it: this survives corrections of the map (MapSnapshot::T_world_camera has where it is then).
  Pose T_reference_camera;
  /// In a frame that no correction of the map, and no new map part, moves: odometry, whose transform to the
  /// map is T_world_camera * inverse(T_odom_camera). It begins at the first tracked frame; each one after
  /// that adds its way since the frame tracked before, as the map has both, so that drift accumulates. Where
  /// the map does not have the way, as when a lost camera goes on in another part, it stays where it was.
  Pose T_odom_camera;
  /// 6x6 row by row, of delta in T_reference_camera * exp(delta), delta = (translation [m], rotation [rad])
  /// in the camera's axes: how well the camera is known relative to the reference keyframe. Where that
  /// keyframe is in the world, and the drift on the way there, is not in it: it is the covariance neither of
  /// T_world_camera nor of T_odom_camera, which have drift. It is as large as the residuals
  /// of the last frames say, and allows for a rolling shutter's readout as long as that is not known: of a
  /// global shutter that CameraRig::readout does not name (0), single axes are up to 15 times too wide. What
  /// no residual shows, a wrong focal length or clock, is not in it. Otherwise honest within a factor of two
  /// in standard deviations where that was measured (docs/results/covariance.md). All zero, and known, for
  /// the frame that starts a map part: that frame defines the world. Not known (covariance_known is false:
  /// the measurements leave a direction open): all NaN.
  std::array<double, 36> covariance = unknown_covariance();
  /// (linear [m/s], angular [rad/s]) in the camera's axes: the mean since the frame tracked before, over the
  /// whole gap after a loss; corrections of the map are not in it. Zero when there is no such frame.
  std::array<double, 6> velocity{};

  std::uint64_t map_version = 0;  ///< of the map that the frame was tracked against
  /// When the frame was exposed, on CLOCK_MONOTONIC; without a pace (SlamOptions::live, speed), when the
  /// tracker took it.
  std::int64_t exposed_ns = 0;
  std::int64_t latency_ns = 0;  ///< from then to the moment the pose was known
};
static_assert(std::is_trivially_copyable_v<PoseEstimate>);

/// Why poses given out before are no longer what the map says. Corrections below a centimetre and 0.2 degrees
/// are not announced, except where parts of the map were joined.
enum class MapEventKind : std::uint8_t {
  kOptimisation,    ///< a round of the double window moved the camera's surroundings
  kLoopClosure,     ///< a place was recognised
  kPoseGraph,       ///< the whole pose graph was optimised
  kPartsJoined,     ///< the camera's map part took another one's world, or another one moved into its world
  kRelocalisation,  ///< the lost camera, or one in a loaded map, found itself in the map
  kNewPart          ///< the lost camera began a map part with a world of its own
};
[[nodiscard]] TWOFOLD_API const char* to_string(MapEventKind kind);

/// Announced before the pose of the first frame that saw it. Corrections say where the last tracked frame was
/// and where the corrected map has it; after a relocalisation, `after` is the frame that found itself.
struct MapEvent {
  MapEventKind kind = MapEventKind::kOptimisation;
  std::int64_t frame = 0;  ///< that saw it first
  std::int64_t t_ns = 0;
  std::uint64_t map_version = 0;
  std::uint32_t keyframe = kNoId;  ///< reference keyframe of that frame; kNoId: it is lost
  std::uint32_t map_part_before = kNoId;
  std::uint32_t map_part = kNoId;
  /// Of the last tracked frame, in the world of `map_part_before`. Before the first one the same as after.
  Pose T_world_camera_before;
  Pose T_world_camera_after;  ///< in the world of `map_part`
  double moved = 0;   ///< distance between the two [m]; 0 across map parts, whose worlds share nothing
  double turned = 0;  ///< angle between the two [rad]; likewise

  // What the correction did to the map; zero for kRelocalisation and kNewPart, which correct nothing. Where
  // one frame sees several versions at once, the largest of each. Which keyframes they are: compare
  // Slam::map().keyframes() with those of a snapshot taken before, by their ids.
  /// The loop that was closed, of kLoopClosure, kPoseGraph and kPartsJoined: the older keyframe. kNoId: none,
  /// or not known. MapSnapshot::loops has more of it.
  std::uint32_t loop_from = kNoId;
  std::uint32_t loop_to = kNoId;  ///< the keyframe that came back
  /// That moved by a centimetre or 0.2 degrees or more, or joined another part.
  std::uint32_t keyframes_moved = 0;
  double farthest_moved = 0;  ///< by a keyframe that kept its part [m]
  double most_turned = 0;     ///< likewise [rad]
};
static_assert(std::is_trivially_copyable_v<MapEvent>);

}  // namespace twofold
