#pragma once

#include <optional>
#include <variant>
#include <vector>

#include "camera/frame.hpp"
#include "engine/frame_pool.hpp"
#include "engine/options.hpp"
#include "engine/result.hpp"
#include "engine/stage_timer.hpp"
#include "graph/keyframe_proposal.hpp"
#include "graph/loop_constraint.hpp"
#include "graph/pose_relaxation.hpp"
#include "loopclosure/loop_closer.hpp"
#include "mapping/mapper.hpp"
#include "tracking/tracker.hpp"

namespace twofold {

using ProposalPool = FramePool<KeyframeProposal>;
using ProposalHandle = ProposalPool::Handle;
/// From the loop closer to the mapper.
using LoopMessage = std::variant<LoopConstraint, PoseRelaxation>;

/// The tracker's step as every kind of run takes it: track, record, time.
class TrackingStage {
 public:
  TrackingStage(const Rig& rig, const TrackerOptions& options, Trace* trace);

  /// @param proposal  free buffer or empty; stays with the caller
  /// @return whether `proposal` was filled and should be sent
  bool step(const Frame& frame, const GraphSnapshot& graph, ProposalHandle& proposal, FrameRecord& record);
  /// The filled proposal could not be sent.
  void proposal_rejected(FrameRecord& record);
  /// Completes the record once the pose is known: how long after its due time that was.
  void finish(std::int64_t scheduled_ns, FrameRecord& record);

  [[nodiscard]] const StageRecorder& times() const { return times_; }
  [[nodiscard]] StageRecorder& times() { return times_; }

 private:
  void announce_correction(const GraphSnapshot& graph, FrameRecord& record) const;

  Tracker tracker_;
  StageRecorder times_;
  StageId frame_stage_;
  StageId latency_stage_;
  std::vector<StageId> stages_;
  TraceName version_counter_;
  FrameRecord last_;  // the last frame that was tracked
};

/// The mapper's step as every kind of run takes it.
class MappingStage {
 public:
  MappingStage(const Rig& rig, const MapperOptions& options, Trace* trace);

  /// One round over the given proposals, oldest first. The new version is then ready to be published.
  MapperRound step(std::span<const ProposalHandle> proposals, std::span<const LoopMessage> messages = {});
  [[nodiscard]] GraphSnapshot publish() { return mapper_.publish(); }
  [[nodiscard]] Mapper& mapper() { return mapper_; }
  [[nodiscard]] const StageRecorder& times() const { return times_; }
  [[nodiscard]] StageRecorder& times() { return times_; }

 private:
  Mapper mapper_;
  StageRecorder times_;
  StageId round_stage_;
  std::vector<KeyframeProposal*> proposals_;
  std::vector<LoopConstraint> loops_;
};

/// The loop closer's step as every kind of run takes it: recognise, verify, and, once the map has taken a
/// loop, relax all of it beside the mapper.
class LoopClosingStage {
 public:
  LoopClosingStage(const Rig& rig, const EngineOptions& options, Trace* trace);

  /// @return what the mapper should know, in order; valid until the next step
  std::span<LoopMessage> step(const KeyframeProposal& keyframe, const GraphSnapshot& graph);

  [[nodiscard]] std::vector<ClosedLoop>& loops() { return loops_; }
  [[nodiscard]] StageRecorder& times() { return times_; }

 private:
  void relax_if_due(const GraphSnapshot& graph);

  Rig rig_;
  MapperOptions mapper_options_;
  std::optional<LoopCloser> closer_;
  StageRecorder times_;
  StageId place_stage_, relax_stage_;
  std::vector<LoopMessage> messages_;
  std::vector<ClosedLoop> loops_;
  std::optional<LoopConstraint> unrelaxed_;  // newest loop that no relaxation has seen
};

}  // namespace twofold
