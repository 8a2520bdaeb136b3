#pragma once

#include <atomic>
#include <optional>
#include <variant>
#include <vector>

#include "camera/frame.hpp"
#include "engine/frame_pool.hpp"
#include "engine/logs/replacement_log.hpp"
#include "engine/options.hpp"
#include "engine/result.hpp"
#include "engine/stage_timer.hpp"
#include "estimation/focal_resection.hpp"
#include "graph/keyframe_proposal.hpp"
#include "graph/loop_constraint.hpp"
#include "graph/pose_graph_update.hpp"
#include "loopclosure/loop_closer.hpp"
#include "mapping/mapper.hpp"
#include "tracking/tracker.hpp"

namespace twofold {

using ProposalPool = FramePool<KeyframeProposal>;
using ProposalHandle = ProposalPool::Handle;
/// From the loop closer to the mapper.
using LoopMessage = std::variant<LoopConstraint, PoseGraphUpdate, SimilarityUpdate>;

/// Of the tracker to the loop closer: where was this frame taken?
struct RelocalisationRequest {
  FrameImages images;
};
using RequestPool = FramePool<RelocalisationRequest>;
using RequestHandle = RequestPool::Handle;
/// The answer, which always comes; nothing when no place was recognised.
using RelocalisationAnswer = std::optional<Relocalisation>;

/// The tracker's step as every kind of run takes it: locate the camera, tell the pose, prepare the next
/// frame.
class TrackerRunner {
 public:
  TrackerRunner(const Rig& rig, const EngineOptions& options, Trace* trace);

  /// Makes room in a pooled buffer before the tracker thread starts, so that it allocates nothing.
  void prepare(KeyframeProposal& proposal) const { tracker_.prepare(proposal); }
  /// Whether the options, and who pauses the map, allow of a keyframe now. Any other frame gets no buffer.
  [[nodiscard]] bool may_propose() const {
    // Relaxed: a wish, which takes effect with one frame or the next.
    return !localise_only_ && (paused_ == nullptr || !paused_->load(std::memory_order_relaxed));
  }
  /// First of three parts of a step: where the camera is. `frame`, `graph` and `proposal` stay as they are
  /// until the last.
  /// @param proposal  free buffer or empty; stays with the caller
  void locate(const Frame& frame, const GraphSnapshot& graph, EffortLevel effort, ProposalHandle& proposal,
              FrameRecord& record);
  /// Second part: the pose is known, at `now_ns` on the clock of the pace, and the listener is told.
  void tell(std::int64_t exposed_ns, std::int64_t now_ns, FrameRecord& record);
  /// Third part: all that nobody waits for who wants the pose. Completes the record.
  /// @return whether `proposal` was filled and should be sent
  bool prepare_next(FrameRecord& record);
  /// Of the map, seen first by the frame of the last step; of reason kNone when there was none.
  [[nodiscard]] const PoseCorrection& correction() const { return correction_; }
  /// True when there is a vocabulary, no answer is awaited, and the camera is lost or not placed yet:
  /// `request` is then filled.
  bool request_relocalisation(RelocalisationRequest& request);
  /// Before the next step.
  void take_answer(const RelocalisationAnswer& answer);
  [[nodiscard]] bool wants_relocalisation() const;
  /// A request was made whose answer has not been taken.
  [[nodiscard]] bool awaits_answer() const { return answer_awaited_; }
  /// Answers so far that named a place.
  [[nodiscard]] std::uint64_t recognised() const { return recognised_; }
  /// Tracker::row_offset.
  [[nodiscard]] double row_offset() const { return tracker_.row_offset(); }
  /// At the end of a run: frames before a start of one camera get the poses that it found out.
  void place_earlier_frames(RecordSequence<FrameRecord>& frames, FrameCounts& counts) const;

  [[nodiscard]] std::optional<ReadoutEstimate> readout() const { return tracker_.readout(); }
  /// Of one camera in a loaded map that does not change, where the calibration's focal length is not that
  /// with which its frames fit into the map: a sentence; else empty.
  [[nodiscard]] std::string focal_note() const;
  [[nodiscard]] const StageRecorder& times() const { return times_; }
  [[nodiscard]] StageRecorder& times() { return times_; }

 private:
  void find_correction(const GraphSnapshot& graph, const FrameRecord& record);
  [[nodiscard]] PoseReport report(const FrameRecord& record) const;

  Tracker tracker_;
  StageRecorder times_;
  StageId frame_stage_;
  StageId latency_stage_;
  StageId listener_stage_, frame_listener_stage_;
  std::vector<StageId> stages_;
  TraceName version_counter_, effort_counter_;
  PoseListener on_pose_, on_frame_;
  FrameRecord last_;  // the last frame that was tracked, with the pose and map it was last said to be in
  struct PlacedFrame {
    KeyframeId reference = kNoKeyframe;
    EarlierFrame frame;
  };
  std::vector<PlacedFrame> earlier_;               // grows when one camera starts
  std::optional<FocalResection> focal_resection_;  // one camera in a map that does not change
  const double focal_sigma_;
  const SensorKind map_sensor_;
  PoseCorrection correction_;
  // Of the last step.
  std::optional<FrameStep> step_;
  std::int64_t begin_ns_ = 0;
  std::int64_t exposed_ns_ = 0;
  bool answer_awaited_ = false;
  std::uint64_t recognised_ = 0;
  const bool can_relocalise_;
  const bool localise_only_;
  const std::atomic<bool>* const paused_;
};

/// The mapper's step as every kind of run takes it.
class MapperRunner {
 public:
  MapperRunner(const Rig& rig, const EngineOptions& options, Trace* trace);

  /// One round over the given proposals, oldest first. Listeners are told of the next version.
  /// @return the new version of the map, ready to be published
  std::uint64_t step(std::span<const ProposalHandle> proposals, std::span<const LoopMessage> messages = {});
  /// Listeners are told that it is published.
  [[nodiscard]] GraphSnapshot publish();
  /// Times, until it is destroyed, the stage in which a version is made and handed out.
  [[nodiscard]] ScopedStage timed_publication() { return {times_, publish_stage_}; }
  /// Likewise, the stage in which versions that nobody reads any more are let go of.
  [[nodiscard]] ScopedStage timed_release() { return {times_, release_stage_}; }
  /// The last version: all poses agree globally, unless the map was not to change.
  [[nodiscard]] GraphSnapshot finish();
  /// What became of the keyframes that were culled.
  [[nodiscard]] ReplacementLog& replacement_log() { return replacement_log_; }
  [[nodiscard]] const MappingTotals& totals() const { return totals_; }
  [[nodiscard]] const StageRecorder& times() const { return times_; }
  [[nodiscard]] StageRecorder& times() { return times_; }

  /// Of a loaded map that was made with another calibration, what differs; else empty.
  [[nodiscard]] const std::string& map_note() const { return map_note_; }

 private:
  void do_round(std::span<const ProposalHandle> proposals, std::span<const LoopMessage> messages);
  void tell_of_next_map();

  Mapper mapper_;
  MapListener on_next_map_, on_map_;
  ReplacementLog replacement_log_;
  const bool may_change_;
  MappingTotals totals_;
  StageRecorder times_;
  StageId round_stage_, listener_stage_, publish_stage_, release_stage_;
  std::vector<KeyframeProposal*> proposals_;
  std::vector<LoopConstraint> loops_;
  std::string map_note_;
};

/// Whether the map has taken a loop that the mapper was sent: its keyframes, or those that stand for them by
/// now, share an edge or, when one was culled since, a neighbour, to which the culled one's edges pass on.
/// Also true when waiting is pointless: its keyframes are forgotten or have become one, or the message seems
/// lost.
[[nodiscard]] bool has_arrived(const GraphSnapshot& graph, const LoopConstraint& loop);

/// The loop closer's step as every kind of run takes it: recognise, verify, and, once the map has taken a
/// loop, optimise all of it beside the mapper. With one camera all of it is optimised over Sim(3) first, and
/// the next loop waits until the map has taken that: its scale would be of a unit that is gone.
class LoopCloserRunner {
 public:
  LoopCloserRunner(const Rig& rig, const EngineOptions& options, Trace* trace);

  /// @return what the mapper should know, in order; valid until the next step
  std::span<LoopMessage> step(const KeyframeProposal& keyframe, const GraphSnapshot& graph);
  /// To be called before the first `count` messages of the last step are sent to the mapper, which has no
  /// room for the others. Where all of them are sent, the step's loop is among loops() and the listener is
  /// told.
  void sending(std::size_t count);

  [[nodiscard]] RelocalisationAnswer relocalise(const RelocalisationRequest& request,
                                                const GraphSnapshot& graph);

  /// How the places it knows look; empty without a vocabulary.
  [[nodiscard]] const KeyframeDatabase& places() const { return closer_ ? closer_->places() : no_places_; }

  [[nodiscard]] std::vector<ClosedLoop>& loops() { return loops_; }
  [[nodiscard]] StageRecorder& times() { return times_; }

 private:
  void optimise_if_due(const GraphSnapshot& graph);
  [[nodiscard]] bool awaits_similarities(const GraphSnapshot& graph);

  Rig rig_;
  MapperOptions mapper_options_;
  PlacesListener on_places_;
  LoopListener on_loop_;
  std::optional<LoopCloser> closer_;
  const KeyframeDatabase no_places_;
  StageRecorder times_;
  StageId place_stage_, place_cpu_stage_, pose_graph_stage_, relocalise_stage_;
  std::vector<LoopMessage> messages_;
  std::optional<ClosedLoop> found_;  // whose constraint is the last of the messages
  std::vector<ClosedLoop> loops_;
  std::optional<LoopConstraint> not_optimised_;  // newest loop that no pose graph optimisation has seen
  std::optional<LoopConstraint> awaited_;        // one camera: sent, but not seen in the map yet
};

/// After the last step of any kind of run: the final map with its places and loops, the frames hung on its
/// keyframes, and the stages' times. Moves what it can out of the runners.
void collect_results(TrackerRunner& tracking, MapperRunner& mapping, LoopCloserRunner& loop_closing,
                     RunResult& result);

}  // namespace twofold
