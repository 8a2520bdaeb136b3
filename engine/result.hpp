#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/readout_estimator.hpp"
#include "engine/logs/record_sequence.hpp"
#include "engine/logs/schedule_log.hpp"
#include "engine/stage_timer.hpp"
#include "engine/trace.hpp"
#include "estimation/focal_length.hpp"
#include "estimation/motion_only.hpp"
#include "graph/keyframe_database.hpp"
#include "graph/loop_constraint.hpp"
#include "graph/snapshot.hpp"
#include "tracking/common/effort.hpp"
#include "tracking/common/lost_cause.hpp"

namespace twofold {

enum class FrameState : std::uint8_t {
  kTracked,     ///< pose known
  kLost,        ///< looked at, no trustworthy pose
  kDropped,     ///< never looked at: when its turn came, its successor was there (LatePolicy)
  kPlacedLater  ///< before one camera's start, which says where it was: has a final pose, and no causal one
};

/// Why poses in the world changed for a reason other than motion.
enum class CorrectionReason : std::uint8_t {
  kNone,
  kOptimisation,  ///< the double window, metric closures included
  kLoopClosure,   ///< a place was recognised
  kPoseGraph,     ///< the whole pose graph was optimised
  kPartsJoined,   ///< the map part of the camera moved to join another one
};
[[nodiscard]] constexpr const char* describe(CorrectionReason reason) {
  switch (reason) {
    case CorrectionReason::kNone:
      return "";
    case CorrectionReason::kOptimisation:
      return "optimisation";
    case CorrectionReason::kLoopClosure:
      return "loop closure";
    case CorrectionReason::kPoseGraph:
      return "pose graph optimised";
    case CorrectionReason::kPartsJoined:
      return "map parts joined";
  }
  return "";
}

/// What moves by less is neither announced nor counted as moved: each round of the mapper moves everything a
/// little.
inline constexpr double kCorrection = 0.01;         // [m]
inline constexpr double kCorrectionAngle = 0.0035;  // [rad]

/// Announced once, with the first frame that is looked at in the corrected map, tracked or lost: the last one
/// tracked before it, where it was said to be and where the new map has it.
struct PoseCorrection {
  CorrectionReason reason = CorrectionReason::kNone;
  std::int64_t frame_index = 0;  ///< of the frame that saw the corrected map first
  std::int64_t t_ns = 0;
  PackedPose T_c_w_before;
  PackedPose T_c_w_after;
};

/// What is remembered of every frame. Beside TrackResult, which says more, as its covariance and the time of
/// each stage, but only until the next frame: 176 bytes stay of each as long as the run goes on.
struct FrameRecord {
  std::int64_t frame_index = 0;
  std::int64_t t_ns = 0;
  PackedPose T_c_ref;                    ///< pose relative to the reference keyframe: survives map changes
  PackedPose T_c_w_causal;               ///< pose in the map as it was known at the frame's own time
  double tracked_share = 0;              ///< inliers over points searched, in [0, 1]
  std::uint64_t snapshot_version = 0;    ///< version of the map it was tracked against
  std::int64_t tracking_ns = 0;          ///< time spent on it by the tracker
  std::int64_t latency_ns = 0;           ///< from its exposure (Pacer) to the moment its pose was known
  KeyframeId reference = kNoKeyframe;    ///< after the run: the keyframe that stands for it in the final map
  KeyframeId part_causal = kNoKeyframe;  ///< map part of T_c_w_causal's world, under its name of then
  std::int16_t inliers = 0;              ///< measurements the pose rests on
  std::int16_t moving = 0;               ///< points seen that move themselves (TrackResult::moving)
  FrameState state = FrameState::kLost;
  bool keyframe = false;                          ///< it was proposed as a keyframe
  EffortLevel effort = EffortLevel::kEverything;  ///< what was left out for want of time
  LostCause cause = LostCause::kNone;             ///< why it was lost
};
/// There is a place for it in the final trajectory.
[[nodiscard]] inline bool has_final_pose(const FrameRecord& record) {
  return record.state == FrameState::kTracked || record.state == FrameState::kPlacedLater;
}
static_assert(sizeof(FrameRecord) == 176, "docs/results/constant_time.md");

/// Where a frame's points were searched: around where this pose, relative to the reference keyframe, puts
/// them.
struct SearchRegions {
  SE3 T_c_ref;
  double radius_px = 0;  ///< in pixels of each point's pyramid level
};

/// A frame as soon as its pose is known; valid during the listener's call only.
struct PoseReport {
  const FrameRecord& record;
  const GraphSnapshot& graph;        ///< the map it was tracked against
  const PoseCorrection& correction;  ///< of the map, seen first by this frame, if there is a reason
  /// Of T_c_ref, left perturbation (v, omega), as large as residuals say; of tracked frames.
  Matrix6 information;
  std::int64_t exposed_ns = 0;             ///< when the frame was exposed (Pacer)
  std::span<const std::int64_t> stage_ns;  ///< what each TrackerStage took
  /// What the pose rests on, outliers included; points in the reference keyframe's frame.
  std::span<const MotionObservation> measured;
  SearchRegions searched;  ///< for these
  /// Rows that right images lie lower than left ones, which the tracker takes back [px].
  double row_offset = 0;
};

/// What the mapper did in all.
struct MappingTotals {
  std::int64_t rounds = 0;        ///< each a version of the map
  std::int64_t metric_loops = 0;  ///< edges added by metric loop closure
  std::int64_t loops = 0;         ///< edges added by large-scale loop closure
  std::int64_t late_loops = 0;    ///< whose keyframes the map had forgotten, or never had
  /// Adjusted all at once when the run ended (Mapper::adjust_all); 0: nothing called for it.
  std::int64_t globally_adjusted_keyframes = 0;
  std::optional<FocalLengthEstimate> focal_length;  ///< of one camera, as the adjusted map shows it
};

/// A loop that was closed by appearance.
struct ClosedLoop {
  LoopConstraint constraint;
  SE3 T_to_from_before;        ///< as the map had it: the difference is the drift
  std::int64_t t_ns = 0;       ///< of the frame that came back
  bool joins_parts = false;    ///< there is no drift then: the keyframes had different worlds
  double travelled = 0;        ///< along the keyframes between both, in the unit of T_to_from
  std::int64_t from_t_ns = 0;  ///< of the older keyframe, which the final map need not have

  /// What the loop corrects, within a part: the pose of the keyframe that came back, where the map had it, in
  /// that keyframe where it is. The translation is by how much its position was wrong, seen from the older
  /// one.
  [[nodiscard]] SE3 drift() const { return constraint.T_to_from * T_to_from_before.inverse(); }
};

/// What became of EngineOptions::checkpoint.
struct CheckpointReport {
  int saved = 0;
  std::uint64_t version = 0;    ///< of the map, saved last
  std::int64_t longest_ns = 0;  ///< a save took
  std::string error;            ///< of the newest save that failed; the file is then the one before
};

/// How many frames there were, forgotten ones included.
struct FrameCounts {
  std::int64_t frames = 0, tracked = 0, placed_later = 0, lost = 0, dropped = 0;

  void add(FrameState state) {
    ++frames;
    tracked += state == FrameState::kTracked;
    lost += state == FrameState::kLost;
    dropped += state == FrameState::kDropped;
  }
};

/// All a run leaves behind.
struct RunResult {
  FrameCounts counts;
  RecordSequence<FrameRecord> frames;          ///< in the order of the source, dropped ones included
  RecordSequence<PoseCorrection> corrections;  ///< in the order of the frames
  MappingTotals mapping;
  std::vector<ClosedLoop> loops;  ///< by appearance, in the order they were found
  GraphSnapshot graph;            ///< after the last round and the final pose graph optimisation
  KeyframeDatabase places;        ///< how the places of its keyframes look
  CheckpointReport checkpoints;
  std::optional<ReadoutEstimate> readout;  ///< of a rolling shutter, if the rig left it open
  std::vector<StageRecorder> times;        ///< one a thread
  ScheduleStreams schedule;
  std::unique_ptr<Trace> trace;  ///< null unless asked for
  /// Wishes (pinning, priority) that were not granted; how the rig differs from the loaded map's.
  std::vector<std::string> notes;
  std::uint64_t keyframes_not_described = 0;  ///< the loop closer's queue was full
  bool interrupted = false;
  /// How often the loop closer told a lost camera where it was when it asked; it may have moved on since.
  std::uint64_t recognised = 0;
  /// Empty, or why the run ended early: a thread failed, the input broke.
  std::string error;
  std::vector<std::string> losses;  ///< what its logs lost, a sentence a file
  /// Stereo: rows that right images lie lower than left ones, taken back while tracking [px]; 0: none.
  double row_offset = 0;
  double cpu_seconds = 0;  ///< all threads, from start to end of the run
  double wall_seconds = 0;
  double peak_rss_mb = 0;
};

/// Latencies of all frames that were looked at.
[[nodiscard]] LatencyHistogram exposure_to_pose(const RunResult& result);

/// There is a place for it in this map. A keyframe that the mapper never got to leaves its frames without
/// one, and so does a culled one whose replacement was lost, as on a disk that is full.
[[nodiscard]] inline bool has_final_pose(const FrameRecord& record, const GraphSnapshot& graph) {
  return has_final_pose(record) && graph.contains(record.reference) &&
         graph.live_replacement(record.reference).has_value();
}

/// Pose in the final map of a frame that has one there.
[[nodiscard]] inline SE3 final_T_c_w(const FrameRecord& record, const GraphSnapshot& graph) {
  return record.T_c_ref.unpacked() * graph.T_k_w(record.reference);
}

}  // namespace twofold
