// All that a run can be told: what each room's options say of themselves, and that the engine names the one.
#include "engine/options.hpp"

#include "engine/engine.hpp"
#include "fixtures/option_rules.hpp"
#include "fixtures/rendered_scene.hpp"
#include "imaging/plane_warp.hpp"

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
  expect_rules<CornerSelectionOptions>({{"faint.score_share", [](auto& o) { o.faint.score_share = 0; }}});
  expect_rules<RightRowsOptions>({{"offset.min_matches", [](auto& o) { o.offset.min_matches = 0; }},
                                  {"corners", [](auto& o) { o.corners = 201; }},
                                  {"quick_corners", [](auto& o) { o.quick_corners = 39; }},
                                  {"significant_px", [](auto& o) { o.significant_px = 0; }},
                                  {"parts_of_row", [](auto& o) { o.parts_of_row = 0; }},
                                  {"looks_at_start", [](auto& o) { o.looks_at_start = 0; }},
                                  {"search_again_after", [](auto& o) { o.search_again_after = -1; }}});
  expect_rules<RowOffsetOptions>({{"corner_threshold", [](auto& o) { o.corner_threshold = 0; }},
                                  {"min_corner_score", [](auto& o) { o.min_corner_score = -1; }},
                                  {"max_spread_px", [](auto& o) { o.max_spread_px = 0; }},
                                  {"max_apart_px", [](auto& o) { o.max_apart_px = 0; }}});
  expect_rules<EpipolarSearchOptions>({{"step_px", [](auto& o) { o.step_px = 0; }},
                                       {"beside_px", [](auto& o) { o.beside_px = -1; }},
                                       {"beyond_px", [](auto& o) { o.beyond_px = -1; }},
                                       {"nearest_share", [](auto& o) { o.nearest_share = 0; }}});
  expect_rules<PoseUncertaintyOptions>({{"newest_regions", [](auto& o) { o.newest_regions = 0; }},
                                        {"newest_split", [](auto& o) { o.newest_split = 1.1; }}});
  expect_rules<MotionOnlyOptions>({{"max_iterations", [](auto& o) { o.max_iterations = 0; }},
                                   {"rounds", [](auto& o) { o.rounds = 0; }},
                                   {"inlier_chi2_mono", [](auto& o) { o.inlier_chi2_mono = 0; }}});
  expect_rules<WindowSolverOptions>({{"max_iterations", [](auto& o) { o.max_iterations = 0; }},
                                     {"initial_damping", [](auto& o) { o.initial_damping = -1; }}});
}

TEST(Options, OfTheTrackersSearchSayWhyTheyAreInvalid) {
  expect_rules<TrackerOptions>(
      {{"effort.points_share", [](auto& o) { o.effort.points_share = 0; }},
       {"right_rows.look_every", [](auto& o) { o.right_rows.look_every = 0; }},
       {"fixed.min_inlier_share", [](auto& o) { o.fixed.min_inlier_share = 0; }},
       {"motion_model.jitter", [](auto& o) { o.motion_model.jitter = -1; }},
       {"shutter.readout.min_points", [](auto& o) { o.shutter.readout.min_points = 5; }},
       {"alignment.coarsest_level", [](auto& o) { o.alignment.coarsest_level = 5; }},
       {"search.radius_px", [](auto& o) { o.search.radius_px = -1; }},
       {"local_map.max_searches", [](auto& o) { o.local_map.max_searches = 0; }},
       {"pose.min_inliers", [](auto& o) { o.pose.min_inliers = 2; }},
       {"depth.patience", [](auto& o) { o.depth.patience = -1; }},
       {"loss.recent_keyframes", [](auto& o) { o.loss.recent_keyframes = 5; }},
       {"monocular_start.candidates", [](auto& o) { o.monocular_start.candidates = 0; }},
       {"keyframes.turn", [](auto& o) { o.keyframes.turn = 0; }},
       {"reference.interval", [](auto& o) { o.reference.interval = 0; }},
       {"new_points.cell_px", [](auto& o) { o.new_points.cell_px = 0; }},
       {"immature.max_failures", [](auto& o) { o.immature.max_failures = 0; }}});
  expect_rules<EffortBoundsOptions>(
      {{"coarse_levels", [](auto& o) { o.coarse_levels = -1; }},
       {"iterations_share", [](auto& o) { o.iterations_share = 1.1; }},
       {"min_motion_iterations", [](auto& o) { o.min_motion_iterations = 0; }},
       {"min_refine_iterations", [](auto& o) { o.min_refine_iterations = 0; }}});
  expect_rules<DenseAlignmentOptions>({{"max_rms", [](auto& o) { o.max_rms = 0; }},
                                       {"doubted_rms_share", [](auto& o) { o.doubted_rms_share = 0; }},
                                       {"light_change", [](auto& o) { o.light_change = 1; }}});
  expect_rules<LocalMapSearchOptions>(
      {{"wanted_matches", [](auto& o) { o.wanted_matches = o.max_searches + 1; }},
       {"neighbour_keyframes", [](auto& o) { o.neighbour_keyframes = 0; }},
       {"min_view_cosine", [](auto& o) { o.min_view_cosine = 1.1; }},
       {"lost_radius_px", [](auto& o) { o.lost_radius_px = 0; }},
       {"min_light_points", [](auto& o) { o.min_light_points = 0; }},
       {"light_change", [](auto& o) { o.light_change = 1; }}});
}

TEST(Options, OfFixedPixelsSayWhyTheyAreInvalid) {
  expect_rules<FixedPixelOptions>({{"min_contrast", [](auto& o) { o.min_contrast = o.same_grey; }},
                                   {"aside_px", [](auto& o) { o.aside_px = 0; }},
                                   {"max_votes", [](auto& o) { o.max_votes = 255 / o.believed + 1; }},
                                   {"against", [](auto& o) { o.against = 256; }},
                                   {"min_in_quarter", [](auto& o) { o.min_in_quarter = 0; }},
                                   {"max_telling", [](auto& o) { o.max_telling = 0; }},
                                   {"more_alone", [](auto& o) { o.more_alone = o.believed + 1; }},
                                   {"touching", [](auto& o) { o.touching = 10; }},
                                   {"rest", [](auto& o) { o.rest = 256; }},
                                   {"chance", [](auto& o) { o.chance = o.believed; }},
                                   {"far_share", [](auto& o) { o.far_share = 0.995; }},
                                   {"nearer", [](auto& o) { o.nearer = 0.9; }}});
}

TEST(Options, OfMotionAndPoseSayWhyTheyAreInvalid) {
  expect_rules<MotionModelOptions>({{"coast_for", [](auto& o) { o.coast_for = -1; }},
                                    {"max_acceleration", [](auto& o) { o.max_acceleration = 0; }},
                                    {"reach_slack", [](auto& o) { o.reach_slack = 0; }}});
  expect_rules<ReadoutOptions>({{"pair_points", [](auto& o) { o.pair_points = 5; }},
                                {"pose_iterations", [](auto& o) { o.pose_iterations = 0; }},
                                {"nearest_share", [](auto& o) { o.nearest_share = 0; }},
                                {"mean_intervals", [](auto& o) { o.mean_intervals = 3; }},
                                {"first_guess", [](auto& o) { o.first_guess = 0; }}});
  expect_rules<ShutterOptions>(
      {{"readout.significant_sigmas", [](auto& o) { o.readout.significant_sigmas = 0; }},
       {"unknown_readout", [](auto& o) { o.unknown_readout = 0; }},
       {"bent_depth", [](auto& o) { o.bent_depth = -1; }}});
  expect_rules<PoseOptions>({{"motion.rounds", [](auto& o) { o.motion.rounds = 0; }},
                             {"min_inlier_share", [](auto& o) { o.min_inlier_share = 1.1; }},
                             {"doubted_inlier_share", [](auto& o) { o.doubted_inlier_share = 0; }},
                             {"settled_searched_share", [](auto& o) { o.settled_searched_share = -0.1; }},
                             {"rough.inlier_share", [](auto& o) { o.rough.inlier_share = 0; }},
                             {"rough.min_mapped", [](auto& o) { o.rough.min_mapped = -1; }},
                             {"rough.rounds", [](auto& o) { o.rough.rounds = 0; }},
                             {"shutter_rounds", [](auto& o) { o.shutter_rounds = 0; }},
                             {"shutter_settled", [](auto& o) { o.shutter_settled = -1; }},
                             {"uncertainty.of_frame", [](auto& o) { o.uncertainty.of_frame = 1.1; }}});
}

TEST(Options, OfDepthSayWhyTheyAreInvalid) {
  expect_rules<DepthPlacementOptions>({{"alignment.max_apart", [](auto& o) { o.alignment.max_apart = 0; }},
                                       {"scarce_inliers", [](auto& o) { o.scarce_inliers = -1; }},
                                       {"telling_candidates", [](auto& o) { o.telling_candidates = -1; }},
                                       {"agreeing_share", [](auto& o) { o.agreeing_share = 0; }}});
  expect_rules<DepthAlignmentOptions>(
      {{"planes.columns", [](auto& o) { o.planes.columns = 2; }},
       {"min_facing", [](auto& o) { o.min_facing = 1.1; }},
       {"max_kernel", [](auto& o) { o.max_kernel = o.kernel / 2; }},
       {"jackknife_share", [](auto& o) { o.jackknife_share = -0.1; }},
       {"max_deviation", [](auto& o) { o.max_deviation = 0; }},
       {"settled_step", [](auto& o) { o.settled_step = 0; }},
       {"nearly_settled_step", [](auto& o) { o.nearly_settled_step = o.settled_step / 2; }},
       {"first_stride", [](auto& o) { o.first_stride = 0; }}});
  expect_rules<DepthPlaneOptions>({{"min_readings_share", [](auto& o) { o.min_readings_share = 0; }},
                                   {"many_columns", [](auto& o) { o.many_columns = 0; }},
                                   {"max_scatter", [](auto& o) { o.max_scatter = 0; }},
                                   {"min_cosine", [](auto& o) { o.min_cosine = -0.1; }},
                                   {"min_noise", [](auto& o) { o.min_noise = 0; }}});
}

TEST(Options, OfALostCameraSayWhyTheyAreInvalid) {
  expect_rules<LossOptions>({{"wide_search.min_agreeing", [](auto& o) { o.wide_search.min_agreeing = 2; }},
                             {"signs.fine_level", [](auto& o) { o.signs.fine_level = -1; }},
                             {"recent_keyframes", [](auto& o) { o.recent_keyframes = 0; }},
                             {"coast_after", [](auto& o) { o.coast_after = 0; }},
                             {"new_part_frames", [](auto& o) { o.new_part_frames = -1; }}});
  expect_rules<LossSignOptions>({{"coarse_level", [](auto& o) { o.coarse_level = o.fine_level; }},
                                 {"covered_contrast", [](auto& o) { o.covered_contrast = 0; }},
                                 {"blurred_detail", [](auto& o) { o.blurred_detail = 1.1; }},
                                 {"gap_intervals", [](auto& o) { o.gap_intervals = 1; }}});
}

TEST(Options, OfKeyframesAndPointsSayWhyTheyAreInvalid) {
  expect_rules<KeyframeDecisionOptions>({{"tracked_share", [](auto& o) { o.tracked_share = 1.1; }},
                                         {"waiting_inliers", [](auto& o) { o.waiting_inliers = -1; }},
                                         {"lost_share", [](auto& o) { o.lost_share = 1.1; }},
                                         {"waiting_way", [](auto& o) { o.waiting_way = -0.1; }},
                                         {"revisiting_way", [](auto& o) { o.revisiting_way = 1.1; }},
                                         {"revisited_after", [](auto& o) { o.revisited_after = 0; }},
                                         {"revisited_share", [](auto& o) { o.revisited_share = 0; }},
                                         {"few_points", [](auto& o) { o.few_points = -1; }},
                                         {"few_tracked_share", [](auto& o) { o.few_tracked_share = 1.1; }},
                                         {"young_map_share", [](auto& o) { o.young_map_share = 1.1; }},
                                         {"urgent_share", [](auto& o) { o.urgent_share = 0.7; }},
                                         {"max_pending", [](auto& o) { o.max_pending = 0; }}});
  expect_rules<ReferenceChoiceOptions>({{"min_gain_share", [](auto& o) { o.min_gain_share = -1; }}});
  expect_rules<NewPointOptions>(
      {{"corner_levels", [](auto& o) { o.corner_levels = 6; }},
       {"min_start_points", [](auto& o) { o.min_start_points = 0; }},
       {"faint_corners.score_share", [](auto& o) { o.faint_corners.score_share = 0; }},
       {"cells_per_corner", [](auto& o) { o.cells_per_corner = 0; }},
       {"min_disparity_px", [](auto& o) { o.min_disparity_px = 0; }},
       {"max_row_shift", [](auto& o) { o.max_row_shift = -1; }},
       {"mistake_ratio", [](auto& o) { o.mistake_ratio = 0; }},
       {"seeds.min_stretch_px", [](auto& o) { o.seeds.min_stretch_px = -1; }}});
  expect_rules<DepthSeedOptions>({{"line.step_px", [](auto& o) { o.line.step_px = 0; }},
                                  {"filter_iterations", [](auto& o) { o.filter_iterations = 0; }},
                                  {"min_inverse_depth", [](auto& o) { o.min_inverse_depth = 0; }}});
  expect_rules<ImmaturePointOptions>(
      {{"max_age", [](auto& o) { o.max_age = -1; }},
       {"max_age_of_one_camera", [](auto& o) { o.max_age_of_one_camera = -1; }},
       {"trusted_after", [](auto& o) { o.trusted_after = 256; }},
       {"moving_after", [](auto& o) { o.moving_after = 0; }}});
}

TEST(Options, OfOneCamerasStartSayWhyTheyAreInvalid) {
  expect_rules<MonocularStartOptions>(
      {{"frames_between", [](auto& o) { o.frames_between = 1; }},
       {"following.coarsest_level", [](auto& o) { o.following.coarsest_level = 5; }},
       {"first_structure.min_points", [](auto& o) { o.first_structure.min_points = 4; }}});
  expect_rules<FirstStructureOptions>({{"min_share", [](auto& o) { o.min_share = 0; }},
                                       {"max_rotation_share", [](auto& o) { o.max_rotation_share = 0; }}});
  expect_rules<CornerFollowingOptions>({{"first_radius_px", [](auto& o) { o.first_radius_px = 0; }},
                                        {"coarse_radius_px", [](auto& o) { o.coarse_radius_px = 0; }},
                                        {"radius_px", [](auto& o) { o.radius_px = 0; }},
                                        {"max_radius_px", [](auto& o) { o.max_radius_px = 1; }},
                                        {"max_iterations", [](auto& o) { o.max_iterations = 0; }}});
  expect_rules<FirstStructureOptions>({{"max_behind_share", [](auto& o) { o.max_behind_share = 1.1; }},
                                       {"decisive_chi2", [](auto& o) { o.decisive_chi2 = -1; }},
                                       {"finest_sigma", [](auto& o) { o.finest_sigma = 0; }},
                                       {"max_point_error", [](auto& o) { o.max_point_error = 0; }},
                                       {"near_share", [](auto& o) { o.near_share = 0; }},
                                       {"max_still_share", [](auto& o) { o.max_still_share = 2; }},
                                       {"fixed_strip", [](auto& o) { o.fixed_strip = -1; }},
                                       {"significant_sigmas", [](auto& o) { o.significant_sigmas = -1; }},
                                       {"gross_chi2", [](auto& o) { o.gross_chi2 = 0; }},
                                       {"same_direction", [](auto& o) { o.same_direction = 2; }},
                                       {"outlier_chi2", [](auto& o) { o.outlier_chi2 = 0; }},
                                       {"adjustment_steps", [](auto& o) { o.adjustment_steps = 0; }},
                                       {"first_gain", [](auto& o) { o.first_gain = 0; }},
                                       {"min_gain", [](auto& o) { o.min_gain = 0; }},
                                       {"same_angle", [](auto& o) { o.same_angle = -1; }},
                                       {"shear_quantile", [](auto& o) { o.shear_quantile = 0; }},
                                       {"max_readouts", [](auto& o) { o.max_readouts = 0; }}});
}

TEST(Options, OfTheMapperSayWhyTheyAreInvalid) {
  expect_rules<MapperOptions>(
      {{"inner_window", [](auto& o) { o.inner_window = 0; }},
       {"outer_window", [](auto& o) { o.outer_window = -1; }},
       {"nearest", [](auto& o) { o.nearest = -1e-9; }},
       {"edge.rot_share", [](auto& o) { o.edge.rot_share = 0; }},
       {"solver.max_iterations", [](auto& o) { o.solver.max_iterations = 0; }},
       {"loop.columns", [](auto& o) { o.loop.columns = 0; }},
       {"loop.min_half_share", [](auto& o) { o.loop.min_half_share = 1.1; }},
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
       {"corners.faint.threshold_share", [](auto& o) { o.corners.faint.threshold_share = 0; }},
       {"recogniser.consistency", [](auto& o) { o.recogniser.consistency = 0; }},
       {"verification.min_inliers", [](auto& o) { o.verification.min_inliers = 3; }},
       {"refinement.min_inlier_share", [](auto& o) { o.refinement.min_inlier_share = 1.5; }},
       {"refinement.solver.rounds", [](auto& o) { o.refinement.solver.rounds = 0; }},
       {"probation.drift.step_distance", [](auto& o) { o.probation.drift.step_distance = 0; }},
       {"probation.drift.step_turn", [](auto& o) { o.probation.drift.step_turn = 0; }},
       {"depths.max_distance_share", [](auto& o) { o.depths.max_distance_share = 0; }},
       {"depths.max_depth_ratio", [](auto& o) { o.depths.max_depth_ratio = 0.9; }},
       {"as_mapped_share", [](auto& o) { o.as_mapped_share = 1.1; }},
       {"max_sigma", [](auto& o) { o.max_sigma = 0; }},
       {"min_scale_points", [](auto& o) { o.min_scale_points = 0; }},
       {"relocalisation_candidates", [](auto& o) { o.relocalisation_candidates = 0; }}});
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
    EXPECT_STREQ(error.what(), "tracker.new_points.cell_px must be a multiple of 4, > 0, is 0");
  }
}

}  // namespace
}  // namespace twofold
