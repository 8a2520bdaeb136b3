// People, plain walls and light that changes, all at once.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdio>

#include "engine/engine.hpp"
#include "evaluation/evaluation.hpp"
#include "synthetic/synthetic_sequence.hpp"

namespace twofold {
namespace {

using synthetic::SyntheticOptions;
using synthetic::SyntheticSequence;

struct Walk {
  int frames = 0, tracked = 0;
  double ate = 0;       ///< [m]
  double path = 0;      ///< [m]
  int with_moving = 0;  ///< frames that show five moving points or more
};

Walk walk(const SyntheticOptions& scene) {
  const SyntheticSequence sequence(scene);
  Trajectory truth;
  for (int i = 0; i < sequence.frame_count(); ++i) truth.push_back({sequence.t_ns(i), sequence.T_w_c(i)});
  const FrameFeed feed = [&, next = 0](Frame& frame) mutable {
    if (next == sequence.frame_count()) return FeedStatus::kEnd;
    frame = sequence.render(next++);
    return FeedStatus::kFrame;
  };
  EngineOptions options;
  options.deterministic = true;
  std::atomic<bool> interrupted{false};
  const RunResult result = Engine(sequence.rig(), options).run(feed, interrupted);
  EXPECT_EQ(result.error, "");
  Walk walk;
  Trajectory estimate;
  for (const FrameRecord& record : result.frames) {
    ++walk.frames;
    walk.with_moving += record.moving >= 5 ? 1 : 0;
    if (record.state != FrameState::kTracked) {
      ADD_FAILURE() << record.frame_index << ": " << describe(record.cause);
      continue;
    }
    ++walk.tracked;
    EXPECT_EQ(result.graph.part(record.reference), KeyframeId{0}) << record.frame_index;
    estimate.push_back({record.t_ns, final_T_c_w(record, result.graph).inverse()});
  }
  const auto evaluation = evaluate(associate(estimate, truth, 1'000'000), {});
  EXPECT_TRUE(evaluation);
  if (evaluation) walk.ate = evaluation->absolute.rmse;
  for (std::size_t i = 1; i < truth.size(); ++i)
    walk.path += (truth[i].T_w_c.translation() - truth[i - 1].T_w_c.translation()).norm();
  return walk;
}

SyntheticOptions small(const char* place, int frames) {
  SyntheticOptions scene;
  scene.scene = place;
  scene.width = 320;
  scene.height = 240;
  scene.f = 210;
  scene.frames = frames;
  scene.fps = 15;
  scene.noise = 4;
  return scene;
}

void expect_not_taken_along(const char* place) {
  SyntheticOptions scene = small(place, 330);
  const Walk alone = walk(scene);
  EXPECT_EQ(alone.with_moving, 0) << place;
  scene.walkers = 4;
  scene.plain = 0.5;
  scene.exposure_steps = 1;
  scene.flicker = 0.1;
  const Walk among_people = walk(scene);
  std::printf("%s: ATE %.4f m alone, %.4f m among people; moving points in %d and %d of %d frames\n", place,
              alone.ate, among_people.ate, alone.with_moving, among_people.with_moving, alone.frames);
  EXPECT_LT(among_people.ate, 3 * alone.ate) << place;
  EXPECT_GT(among_people.with_moving, 10) << place;
}

TEST(HardPlaces, PeopleInTheCourtyardDoNotTakeTheCameraAlong) {
  expect_not_taken_along("courtyard");
}

TEST(HardPlaces, PeopleInTheCorridorDoNotTakeTheCameraAlong) {
  expect_not_taken_along("corridor");
}

TEST(HardPlaces, ABareCorridorIsTrackedByItsDepth) {
  SyntheticOptions scene = small("corridor", 160);
  scene.sensor = SensorKind::kRgbd;
  scene.bare = true;
  const Walk bare = walk(scene);
  std::printf("bare corridor: ATE %.4f m of %.1f m, %d of %d frames\n", bare.ate, bare.path, bare.tracked,
              bare.frames);
  EXPECT_EQ(bare.tracked, bare.frames);
  EXPECT_LT(bare.ate, 0.01 * bare.path);
}

}  // namespace
}  // namespace twofold
