#include <gtest/gtest.h>

#include <vector>

#include "engine/effort_controller.hpp"
#include "engine/pipeline.hpp"
#include "engine/runners.hpp"
#include "fixtures/rendered_scene.hpp"
#include "imaging/image_buffers.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "tests/allocation_counter.hpp"

namespace twofold {
namespace {

using testing::allocations;

/// The camera goes ahead and turns.
class Walk {
 public:
  [[nodiscard]] const Rig& rig() const { return rig_; }

  Frame frame(int i, bool covered = false) {
    const SE3 T_c_w(SO3::exp(Vector3(0, 0.02 * i, 0)), Vector3(-0.02 * i, 0, -0.02 * i));
    FrameImages images;
    scene_.render(T_c_w, 1.5, images);
    Frame frame{
        i, i * std::int64_t{33'000'000}, images.left.level(0).clone(), images.right.level(0).clone(), {}};
    if (covered) frame.left.setTo(5), frame.right.setTo(5);
    return frame;
  }

 private:
  Rig rig_ = testing::test_rig(SensorKind::kStereo, 320, 240);
  testing::RenderedScene scene_{rig_, {3, 2, 5}, 21};
};

/// All that the tracker thread does with a frame, with recorders and trace on: tracked frames, keyframes,
/// lost frames, the question where it is, and its answer.
TEST(TrackerThread, NeverAllocates) {
  if (!testing::allocations_are_counted()) GTEST_SKIP() << "the sanitizer has its own allocator";
  Walk walk;
  const Rig& rig = walk.rig();
  EngineOptions options;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  Trace trace;
  TrackerRunner tracking(rig, options, &trace);
  MapperRunner mapping(rig, options, &trace);
  LoopCloserRunner loop_closing(rig, options, &trace);
  ProposalPool proposals(4, [&](KeyframeProposal& proposal) { tracking.prepare(proposal); });
  RequestPool requests(2, [&](RelocalisationRequest& r) { allocate_images(rig, r.images); });
  EffortController controller({}, LatePolicy::kQueue);
  GraphSnapshot graph = mapping.publish();

  int keyframes = 0, lost = 0, asked = 0;
  ProposalHandle proposal = proposals.try_acquire();
  std::vector<ProposalHandle> sent;
  std::optional<RelocalisationAnswer> answer;
  for (int i = 0; i < 36; ++i) {
    const Frame frame = walk.frame(i, i >= 20 && i < 25);
    const std::uint64_t before = allocations();
    FrameRecord record;
    if (answer) tracking.take_answer(*answer);
    tracking.locate(frame, graph, controller.effort(), proposal, record);
    tracking.tell(0, 40'000'000, record);
    const bool proposed = tracking.prepare_next(record);
    controller.tracked(i < 4 ? 40'000'000 : 5'000'000, 33'000'000);
    RequestHandle request;
    if (tracking.wants_relocalisation()) {
      request = requests.try_acquire();
      ASSERT_TRUE(request && tracking.request_relocalisation(*request));
    }
    EXPECT_EQ(allocations(), before) << "frame " << i << (proposed ? ", a keyframe" : "");
    // The other threads' work.
    answer.reset();
    if (request) answer = loop_closing.relocalise(*request, graph);
    asked += static_cast<bool>(request);
    lost += record.state == FrameState::kLost;
    keyframes += proposed;
    if (!proposed) continue;
    sent.push_back(std::move(proposal));
    (void)mapping.step(sent);
    graph = mapping.publish();
    (void)loop_closing.step(*sent.front(), graph);
    sent.clear();
    proposal = proposals.try_acquire();
    ASSERT_TRUE(proposal);
  }
  EXPECT_GE(keyframes, 3);
  EXPECT_GE(lost, 3);
  EXPECT_GE(asked, 1);
}

/// One camera that looks for itself in a map of elsewhere: it has no use for a start of its own.
TEST(TrackerThread, NeverAllocatesWhereOneCameraOnlyLocalises) {
  if (!testing::allocations_are_counted()) GTEST_SKIP() << "the sanitizer has its own allocator";
  Walk walk;
  EngineOptions options;
  options.deterministic = true;
  const auto mapping = make_pipeline(walk.rig(), options);
  for (int i = 0; i < 4; ++i) mapping->push(walk.frame(i));
  mapping->stop();
  const RunResult mapped = mapping->finish();
  options.map = std::make_shared<const SavedMap>(SavedMap{walk.rig(), mapped.graph, mapped.places});
  options.localise_only = true;
  Rig one_camera = walk.rig();
  one_camera.kind = SensorKind::kMono;
  TrackerRunner tracking(one_camera, options, nullptr);
  ProposalHandle none;
  for (int i = 0; i < 40; ++i) {
    Frame frame = walk.frame(i);
    frame.right.release();
    const std::uint64_t before = allocations();
    FrameRecord record;
    tracking.locate(frame, mapped.graph, EffortLevel{}, none, record);
    tracking.tell(0, 0, record);
    (void)tracking.prepare_next(record);
    EXPECT_EQ(allocations(), before) << "frame " << i;
    EXPECT_EQ(record.state, FrameState::kLost);
  }
}

/// Its first keyframes neither: what their images go to is there when it begins, as in a threaded run. The
/// listeners are called before and after what is done about a keyframe.
TEST(DeterministicRun, HasRoomForKeyframesWhenItBegins) {
  if (!testing::allocations_are_counted()) GTEST_SKIP() << "the sanitizer has its own allocator";
  Walk walk;
  EngineOptions options;
  options.deterministic = true;
  std::uint64_t before = 0;
  int keyframes = 0;
  options.on_pose = [&](const PoseReport&) { before = allocations(); };
  options.on_frame = [&](const PoseReport& report) {
    EXPECT_EQ(allocations(), before) << "frame " << report.record.frame_index;
    keyframes += report.record.keyframe && report.record.frame_index > 0;
  };
  const auto run = make_pipeline(walk.rig(), options);
  for (int i = 0; i < 12; ++i) run->push(walk.frame(i));
  EXPECT_GE(keyframes, 1);
}

}  // namespace
}  // namespace twofold
