// A camera of few frames a second: each sees much that the one before did not.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>

#include "loopclosure/default_vocabulary.hpp"
#include "synthetic/image_effects.hpp"
#include "synthetic/renderer.hpp"
#include "synthetic/scenes.hpp"
#include "tests/engine/run_checks.hpp"
#include "tests/engine/whole_run.hpp"

namespace twofold {
namespace {

constexpr int kFrames = 50;
constexpr double kTurn = 10 * std::numbers::pi / 180;  ///< from frame to frame [rad]
constexpr std::int64_t kInterval = 200'000'000;        // [ns]

/// On a circle, looking outwards: 8 cm and 10 degrees a frame, one round and a third of the next.
SE3 T_c_w(int i) {
  const double angle = kTurn * i;
  return SE3(SO3::exp(Vector3(0, angle, 0)), 0.45 * Vector3(std::sin(angle), 0, std::cos(angle))).inverse();
}

TEST(WideSteps, AreTakenWithoutASecondPartAndTheRoundIsClosed) {
  std::vector<Frame> frames = testing::render_walk(T_c_w, 0, kFrames, 5);
  for (Frame& frame : frames) frame.t_ns = 1'000'000'000 + frame.index * kInterval;
  const FrameFeed feed = [&, next = std::size_t{0}](Frame& frame) mutable {
    if (next == frames.size()) return FrameStatus::kEnd;
    frame = frames[next++];
    return FrameStatus::kFrame;
  };
  EngineOptions options;
  options.deterministic = true;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  const RunResult result = testing::run_engine(options, feed);
  ASSERT_EQ(result.frames.size(), frames.size());
  for (const FrameRecord& record : result.frames) {
    const int i = static_cast<int>(record.frame_index);
    ASSERT_EQ(record.state, FrameState::kTracked) << i << ": " << describe(record.cause);
    EXPECT_EQ(result.graph.part(record.reference), KeyframeId{0}) << i;
    EXPECT_LT(testing::position_error(record, result.graph, T_c_w(i) * T_c_w(0).inverse()), 0.03) << i;
  }
  EXPECT_GE(result.loops.size() + static_cast<std::size_t>(result.mapping.metric_loops), 1U);
}

/// Where the frame was taken that was recognised, the camera is no more when the answer comes: what that
/// frame shows leads on.
TEST(WideSteps, AfterALossTheFrameThatWasRecognisedLeadsOn) {
  constexpr int kMapped = 22, kCovered = 3, kEvery = 2, kSeen = 6;
  std::vector<Frame> frames = testing::render_walk(T_c_w, 0, kMapped, 5);
  frames.resize(kMapped + kCovered);
  for (int i = kMapped; i < kMapped + kCovered; ++i) {
    Frame& frame = frames[static_cast<std::size_t>(i)];
    frame.right = frame.left = cv::Mat(240, 320, CV_8UC1, cv::Scalar(12));
  }
  for (int n = 0; n < kSeen; ++n) frames.push_back(frames[static_cast<std::size_t>(kEvery * n)]);
  const FrameFeed feed = [&, next = 0](Frame& frame) mutable {
    if (next == static_cast<int>(frames.size())) return FrameStatus::kEnd;
    frame = frames[static_cast<std::size_t>(next)];
    frame.index = next;
    frame.t_ns = 1'000'000'000 + next++ * kInterval;
    return FrameStatus::kFrame;
  };
  EngineOptions options;
  options.deterministic = true;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  options.tracker.loss.new_part_after = 10;
  const RunResult result = testing::run_engine(options, feed);
  for (const FrameRecord& record : result.frames) {
    const int n = static_cast<int>(record.frame_index) - kMapped - kCovered;
    if (n < 1) continue;  // the first one is lost, and asks
    ASSERT_EQ(record.state, FrameState::kTracked) << n << ": " << describe(record.cause);
    EXPECT_LT(testing::position_error(record, result.graph, T_c_w(kEvery * n) * T_c_w(0).inverse()), 0.03)
        << n;
  }
}

/// A camera that is carried through a place at 5 Hz and looks around: it turns by 10 degrees from frame to
/// frame, up to 50 degrees to either side of where it goes.
class LookingAround {
 public:
  LookingAround(synthetic::Staging staging, double speed, double step)
      : staging_(std::move(staging)), seconds_(step / speed) {}

  /// Frames once around, and a bit farther.
  [[nodiscard]] int frames() const { return static_cast<int>(1.15 * staging_.round_seconds / seconds_); }
  [[nodiscard]] SE3 T_w_c(int i) const {
    constexpr int kAside = 5;  // steps
    const int phase = (i + kAside) % (4 * kAside);
    const int steps = phase < 2 * kAside ? phase - kAside : 3 * kAside - phase;
    return staging_.path(seconds_ * i) * SE3(SO3::exp(Vector3(0, kTurn * steps, 0)), Vector3::Zero());
  }
  [[nodiscard]] Frame render(int i) const {
    const Rig rig = testing::small_rig();
    const synthetic::Renderer renderer(staging_.scene);
    const auto image = [&](double right, std::uint64_t stream) {
      const SE3 T_w_eye = T_w_c(i) * SE3(SO3(), Vector3(right, 0, 0));
      return synthetic::expose(renderer.render(rig.camera, T_w_eye).intensity, 1, 2, {5, stream});
    };
    Frame frame;
    frame.index = i;
    frame.t_ns = 1'000'000'000 + i * kInterval;
    frame.left = image(0, 2 * static_cast<std::uint64_t>(i));
    frame.right = image(rig.baseline, 2 * static_cast<std::uint64_t>(i) + 1);
    return frame;
  }

 private:
  synthetic::Staging staging_;
  double seconds_;  ///< of the walk, from frame to frame
};

void expect_round_closed(const char* name, const LookingAround& walk, double max_ate) {
  const FrameFeed feed = [&, next = 0](Frame& frame) mutable {
    if (next == walk.frames()) return FrameStatus::kEnd;
    frame = walk.render(next++);
    return FrameStatus::kFrame;
  };
  EngineOptions options;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  const auto [result, path] = testing::run_whole(testing::small_rig(), feed, options);
  Trajectory truth;
  int tracked = 0;
  int keyframes = 0;
  for (const FrameRecord& record : result.frames) {
    const int i = static_cast<int>(record.frame_index);
    truth.push_back({record.t_ns, walk.T_w_c(i)});
    EXPECT_EQ(record.state, FrameState::kTracked) << name << " " << i << ": " << describe(record.cause);
    if (record.state != FrameState::kTracked) continue;
    ++tracked;
    keyframes += record.keyframe ? 1 : 0;
    EXPECT_EQ(result.graph.part(record.reference), KeyframeId{0}) << name << " " << i;
  }
  const auto evaluation = evaluate(associate(path, truth, 1'000'000), {});
  ASSERT_TRUE(evaluation);
  std::printf("%s: %d of %d frames, %d keyframes, ATE %.4f m, %zu and %lld loops\n", name, tracked,
              walk.frames(), keyframes, evaluation->absolute.rmse, result.loops.size(),
              static_cast<long long>(result.mapping.metric_loops));
  EXPECT_LT(evaluation->absolute.rmse, max_ate) << name;
  EXPECT_GE(result.loops.size() + static_cast<std::size_t>(result.mapping.metric_loops), 1U) << name;
}

TEST(WideSteps, AroundTheCourtyard) {
  for (const double step : {0.08, 0.2})
    expect_round_closed("courtyard", LookingAround(synthetic::make_courtyard(1), 40.0 / 30, step), 0.05);
}

TEST(WideSteps, AroundTheCorridor) {
  for (const double step : {0.08, 0.2})
    expect_round_closed("corridor", LookingAround(synthetic::make_corridor(1), 1, step), 0.05);
}

}  // namespace
}  // namespace twofold
