// All that a run can be told: what each room's options say of themselves, and that the engine names the one.
#include "engine/options.hpp"

#include "engine/engine.hpp"
#include "fixtures/option_rules.hpp"
#include "fixtures/rendered_scene.hpp"
#include "imaging/plane_warp.hpp"
#include "loopclosure/vocabulary_trainer.hpp"

namespace twofold {
namespace {

using testing::expect_rules;

TEST(Options, OfImagingAndEstimationSayWhyTheyAreInvalid) {
  expect_rules<GuidedSearchOptions>({{"radius_px", [](auto& o) { o.radius_px = 0; }},
                                     {"max_rms", [](auto& o) { o.max_rms = 0; }},
                                     {"refine_iterations", [](auto& o) { o.refine_iterations = 0; }},
                                     {"right_search_px", [](auto& o) { o.right_search_px = 0; }}});
  expect_rules<SurfaceAlignmentOptions>({{"max_iterations", [](auto& o) { o.max_iterations = 0; }},
                                         {"max_move_px", [](auto& o) { o.max_move_px = 0; }}});
  expect_rules<MotionOnlyOptions>({{"max_iterations", [](auto& o) { o.max_iterations = 0; }},
                                   {"rounds", [](auto& o) { o.rounds = 0; }},
                                   {"inlier_chi2_mono", [](auto& o) { o.inlier_chi2_mono = 0; }}});
  expect_rules<WindowSolverOptions>({{"max_iterations", [](auto& o) { o.max_iterations = 0; }},
                                     {"initial_damping", [](auto& o) { o.initial_damping = -1; }}});
}

TEST(Options, OfTheTrackerSayWhyTheyAreInvalid) {
  expect_rules<TrackerOptions>(
      {{"alignment.coarsest_level", [](auto& o) { o.alignment.coarsest_level = 5; }},
       {"new_points.corner_levels", [](auto& o) { o.new_points.corner_levels = 6; }},
       {"search.radius_px", [](auto& o) { o.search.radius_px = -1; }},
       {"loss.wide_search.min_agreeing", [](auto& o) { o.loss.wide_search.min_agreeing = 2; }},
       {"pose.motion.rounds", [](auto& o) { o.pose.motion.rounds = 0; }},
       {"local_map.wanted_matches",
        [](auto& o) { o.local_map.wanted_matches = o.local_map.max_searches + 1; }},
       {"pose.min_inliers", [](auto& o) { o.pose.min_inliers = 2; }},
       {"loss.new_part_frames", [](auto& o) { o.loss.new_part_frames = -1; }},
       {"pose.rough.rounds", [](auto& o) { o.pose.rough.rounds = 0; }},
       {"fixed.min_inlier_share", [](auto& o) { o.fixed.min_inlier_share = 0; }},
       {"new_points.min_start_points", [](auto& o) { o.new_points.min_start_points = 0; }},
       {"loss.recent_keyframes", [](auto& o) { o.loss.recent_keyframes = 5; }},
       {"depth.patience", [](auto& o) { o.depth.patience = -1; }},
       {"keyframes.turn", [](auto& o) { o.keyframes.turn = 0; }},
       {"keyframes.young_map_share", [](auto& o) { o.keyframes.young_map_share = 1.1; }},
       {"depth.alignment.max_apart", [](auto& o) { o.depth.alignment.max_apart = 0; }},
       {"depth.alignment.min_facing", [](auto& o) { o.depth.alignment.min_facing = 1.1; }},
       {"depth.alignment.widest_kernel",
        [](auto& o) { o.depth.alignment.widest_kernel = o.depth.alignment.kernel / 2; }},
       {"depth.alignment.jackknife_share", [](auto& o) { o.depth.alignment.jackknife_share = -0.1; }},
       {"readout.min_points", [](auto& o) { o.readout.min_points = 5; }},
       {"readout.significant_sigmas", [](auto& o) { o.readout.significant_sigmas = 0; }},
       {"keyframes.tracked_share", [](auto& o) { o.keyframes.tracked_share = 1.1; }},
       {"keyframes.urgent_share", [](auto& o) { o.keyframes.urgent_share = 0.7; }},
       {"monocular_start.candidates", [](auto& o) { o.monocular_start.candidates = 0; }},
       {"monocular_start.frames_between", [](auto& o) { o.monocular_start.frames_between = 1; }},
       {"monocular_start.first_structure.max_behind_share",
        [](auto& o) { o.monocular_start.first_structure.max_behind_share = 1.1; }},
       {"monocular_start.first_structure.decisive_chi2",
        [](auto& o) { o.monocular_start.first_structure.decisive_chi2 = -1; }},
       {"monocular_start.first_structure.finest_sigma",
        [](auto& o) { o.monocular_start.first_structure.finest_sigma = 0; }},
       {"monocular_start.first_structure.max_point_error",
        [](auto& o) { o.monocular_start.first_structure.max_point_error = 0; }},
       {"monocular_start.first_structure.near_share",
        [](auto& o) { o.monocular_start.first_structure.near_share = 0; }},
       {"monocular_start.first_structure.max_still_share",
        [](auto& o) { o.monocular_start.first_structure.max_still_share = 2; }},
       {"monocular_start.first_structure.fixed_strip",
        [](auto& o) { o.monocular_start.first_structure.fixed_strip = -1; }},
       {"new_points.cell_px", [](auto& o) { o.new_points.cell_px = 0; }}});
}

TEST(Options, OfTheMapperSayWhyTheyAreInvalid) {
  expect_rules<MapperOptions>(
      {{"inner_window", [](auto& o) { o.inner_window = 0; }},
       {"outer_window", [](auto& o) { o.outer_window = -1; }},
       {"max_inverse_depth", [](auto& o) { o.max_inverse_depth = o.min_inverse_depth; }},
       {"edge.rot_share", [](auto& o) { o.edge.rot_share = 0; }},
       {"solver.max_iterations", [](auto& o) { o.solver.max_iterations = 0; }},
       {"loop.columns", [](auto& o) { o.loop.columns = 0; }},
       {"loop.consensus.confidence", [](auto& o) { o.loop.consensus.confidence = 1; }},
       {"culling.redundant_observers", [](auto& o) { o.culling.redundant_observers = 1; }},
       {"culling.keep_replacements", [](auto& o) { o.culling.keep_replacements = 1; }},
       {"culling.max_misses", [](auto& o) { o.culling.max_misses = 256; }},
       {"culling.max_scale_change", [](auto& o) { o.culling.max_scale_change = 0.9; }}});
}

TEST(Options, OfTheLoopCloserSayWhyTheyAreInvalid) {
  expect_rules<LoopCloserOptions>(
      {{"corners.levels", [](auto& o) { o.corners.levels = 4; }},
       {"corners.wanted", [](auto& o) { o.corners.wanted = 0; }},
       {"recogniser.consistency", [](auto& o) { o.recogniser.consistency = 0; }},
       {"verification.min_inliers", [](auto& o) { o.verification.min_inliers = 3; }},
       {"refinement.min_inlier_share", [](auto& o) { o.refinement.min_inlier_share = 1.5; }},
       {"refinement.solver.rounds", [](auto& o) { o.refinement.solver.rounds = 0; }},
       {"probation.drift.step_distance", [](auto& o) { o.probation.drift.step_distance = 0; }},
       {"probation.drift.step_turn", [](auto& o) { o.probation.drift.step_turn = 0; }},
       {"depths.max_distance_share", [](auto& o) { o.depths.max_distance_share = 0; }},
       {"depths.max_depth_ratio", [](auto& o) { o.depths.max_depth_ratio = 0.9; }},
       {"min_scale_points", [](auto& o) { o.min_scale_points = 0; }},
       {"relocalisation_candidates", [](auto& o) { o.relocalisation_candidates = 0; }}});
  expect_rules<VocabularyTrainerOptions>(
      {{"branching", [](auto& o) { o.branching = 1; }}, {"levels", [](auto& o) { o.levels = 7; }}});
}

TEST(Options, OfRunLogsSayWhyTheyAreInvalid) {
  expect_rules<RunLogOptions>({{"frames_in_memory", [](auto& o) { o.frames_in_memory = 0; }}});
}

TEST(Options, OfTheEngineSayWhyTheyAreInvalid) {
  expect_rules<EngineOptions>(
      {{"tracker.pose.min_inliers", [](auto& o) { o.tracker.pose.min_inliers = 0; }},
       {"mapper.inner_window", [](auto& o) { o.mapper.inner_window = 0; }},
       {"loop_closer.corners.wanted", [](auto& o) { o.loop_closer.corners.wanted = 0; }},
       {"checkpoint.period", [](auto& o) { o.checkpoint.period = -1; }},
       {"logs.frames_in_memory", [](auto& o) { o.logs.frames_in_memory = 0; }},
       {"pacing.speed", [](auto& o) { o.pacing.speed = -1; }},
       {"effort.patience", [](auto& o) { o.effort.patience = 0; }},
       {"frame_slots", [](auto& o) { o.frame_slots = 0; }},
       {"proposal_slots", [](auto& o) { o.proposal_slots = 17; }},
       {"tracker_cpu", [](auto& o) { o.tracker_cpu = -1; }},
       {"fifo_priority", [](auto& o) { o.fifo_priority = 100; }}});
}

TEST(Options, TheEngineRefusesThoseThatAreInvalid) {
  EngineOptions options;
  options.tracker.new_points.cell_px = 0;
  try {
    Engine(testing::test_rig(SensorKind::kStereo), options);
    ADD_FAILURE() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "tracker.new_points.cell_px must be >= 1, is 0");
  }
}

}  // namespace
}  // namespace twofold
