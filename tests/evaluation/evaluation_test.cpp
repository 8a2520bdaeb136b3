#include "evaluation/evaluation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <numbers>
#include <random>

#include "io/files/trajectory_file.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

Trajectory helix(int count) {
  Trajectory trajectory;
  for (int i = 0; i < count; ++i) {
    const double a = 0.05 * i;
    trajectory.push_back({i * 100'000'000LL, SE3(SO3::exp(Vector3(0.1 * std::sin(a), a, 0)),
                                                 Vector3(3 * std::cos(a), 3 * std::sin(a), 0.1 * a))});
  }
  return trajectory;
}

Trajectory moved(const Trajectory& trajectory, const Sim3& S) {
  Trajectory result = trajectory;
  for (TimedPose& pose : result) pose.T_w_c = aligned_pose(S, pose.T_w_c);
  return result;
}

TEST(Evaluation, AlignmentUndoesAnySimilarity) {
  const auto truth = helix(200);
  const Sim3 S(0.4, SO3::exp(Vector3(0.5, -1.0, 2.0)), Vector3(7, -3, 2));
  EvaluationOptions options;
  options.alignment = Alignment::kSim3;
  const auto result = evaluate(associate(moved(truth, S), truth, 0), options);
  ASSERT_TRUE(result);
  EXPECT_NEAR(result->S_w_e.scale(), 2.5, 1e-12);
  EXPECT_LT(result->absolute.max, 1e-12);
  EXPECT_LT(result->absolute_rotation_deg.max, 1e-5);
  EXPECT_LT(result->per_metre.translation.max, 1e-12);
}

/// No other similarity has a smaller squared error.
TEST(Evaluation, Sim3AlignmentIsTheLeastSquaresOne) {
  const auto truth = helix(100);
  auto estimate = moved(truth, Sim3(2.0, SO3::exp(Vector3(0.1, 0.2, 0.3)), Vector3(1, 2, 3)));
  std::mt19937 rng(11);
  std::normal_distribution<double> noise(0, 0.2);
  for (auto& pose : estimate) pose.T_w_c.translation() += Vector3(noise(rng), noise(rng), noise(rng));
  const auto pairs = associate(estimate, truth, 0);
  const auto cost = [&](const Sim3& S) {
    double sum = 0;
    for (const auto& pair : pairs) {
      sum += (pair.T_w_c.translation() - aligned_pose(S, pair.T_e_c).translation()).squaredNorm();
    }
    return sum;
  };
  const auto best = align(pairs, Alignment::kSim3);
  ASSERT_TRUE(best);
  for (int k = 0; k < 7; ++k) {
    for (const double step : {-1e-3, 1e-3}) {
      Vector7 delta = Vector7::Zero();
      delta[k] = step;
      EXPECT_GT(cost(Sim3::exp(delta) * *best), cost(*best)) << "along " << k;
    }
  }
}

TEST(Evaluation, TellsTheScaleOfEachHalf) {
  const auto truth = helix(200);
  auto estimate = moved(truth, Sim3(0.5, SO3(), Vector3(1, 2, 3)));
  const auto second = moved(truth, Sim3(0.4, SO3::exp(Vector3(0, 0.2, 0)), Vector3(3, 0, 1)));
  std::copy(second.begin() + 100, second.end(), estimate.begin() + 100);
  const auto pairs = associate(estimate, truth, 0);
  const auto evaluation = evaluate(pairs, {.alignment = Alignment::kSim3});
  ASSERT_TRUE(evaluation && evaluation->half_scales);
  EXPECT_NEAR((*evaluation->half_scales)[0], 2, 1e-9);
  EXPECT_NEAR((*evaluation->half_scales)[1], 2.5, 1e-9);
  EXPECT_FALSE(evaluate(pairs, {.alignment = Alignment::kSe3})->half_scales);
  EXPECT_FALSE(scales_of_halves({pairs.begin(), pairs.begin() + 5}));
}

TEST(Evaluation, RelativeErrorOfAKnownDrift) {
  // 1 m a second along x, estimate 2 % too long: 0.02 m a second and a metre, whatever the alignment.
  Trajectory truth, estimate;
  for (int i = 0; i <= 100; ++i) {
    truth.push_back({i * 100'000'000LL, SE3(SO3(), Vector3(0.1 * i, 0, 0))});
    estimate.push_back({i * 100'000'000LL, SE3(SO3(), Vector3(0.102 * i, 0, 0))});
  }
  EvaluationOptions options;
  options.alignment = Alignment::kNone;
  const auto result = evaluate(associate(estimate, truth, 0), options);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->per_second.translation.count, 91u);
  EXPECT_NEAR(result->per_second.translation.rmse, 0.02, 1e-12);
  EXPECT_NEAR(result->per_metre.translation_percent.mean, 2.0, 1e-9);
  EXPECT_NEAR(result->absolute.max, 0.2, 1e-12);
  EXPECT_NEAR(result->path_length, 10.0, 1e-12);
  EXPECT_EQ(result->per_second.rotation_deg.max, 0.0);
  options.alignment = Alignment::kSe3;
  const auto line = evaluate(associate(estimate, truth, 0), options);
  ASSERT_FALSE(line) << "the turn about a line is undetermined";
  EXPECT_EQ(
      line.error(),
      "cannot be aligned: 101 poses have a partner in time, all on one line (align none compares them as "
      "they are)");
  truth.resize(2);
  const auto few = evaluate(associate(estimate, truth, 0), options);
  ASSERT_FALSE(few);
  EXPECT_EQ(few.error(),
            "cannot be aligned: 2 poses have a partner in time, it takes three (align none compares them as "
            "they are)");
}

/// Along x a metre apart, the estimate `too_long` by that share and turned about z by `turn_deg` a metre.
std::vector<PosePair> straight_way(int metres, double too_long, double turn_deg) {
  std::vector<PosePair> pairs;
  for (int i = 0; i <= metres; ++i) {
    const SO3 R = SO3::exp(Vector3(0, 0, turn_deg * i * std::numbers::pi / 180));
    pairs.push_back(
        {i * 100'000'000LL, SE3(R, Vector3((1 + too_long) * i, 0, 0)), SE3(SO3(), Vector3(i, 0, 0))});
  }
  return pairs;
}

TEST(Evaluation, RelativeErrorPerMetreBeginsAtTheFirstPose) {
  Trajectory truth, estimate;
  for (int i = 0; i <= 40; ++i) {
    const double x = 0.25 * i, wrong = 0.1 * std::min(x, 1.0);  // in the first metre only
    truth.push_back({i * 100'000'000LL, SE3(SO3(), Vector3(x, 0, 0))});
    estimate.push_back({i * 100'000'000LL, SE3(SO3(), Vector3(x + wrong, 0, 0))});
  }
  const auto result = evaluate(associate(estimate, truth, 0), {.alignment = Alignment::kNone});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->per_metre.translation.count, 10u);
  EXPECT_NEAR(result->per_metre.translation.max, 0.1, 1e-12);
}

TEST(Evaluation, KittiErrorsOfAKnownDrift) {
  const KittiErrors errors = kitti_errors(straight_way(1000, 0.02, 0));
  ASSERT_EQ(errors.by_length.size(), 8u);
  std::size_t segments = 0;
  for (const SegmentErrors& e : errors.by_length) {
    // The last pose is the first one beyond the length: a metre more than that lies between.
    EXPECT_NEAR(e.translation_percent, 2 * (e.length + 1) / e.length, 1e-9) << e.length;
    EXPECT_EQ(e.rotation_deg_per_100_m, 0) << e.length;
    EXPECT_EQ(e.count, static_cast<std::size_t>((1000 - e.length) / 10)) << e.length;
    segments += e.count;
  }
  EXPECT_EQ(errors.mean.count, segments);
  EXPECT_GT(errors.mean.translation_percent, 2 * 801.0 / 800);
  EXPECT_LT(errors.mean.translation_percent, 2 * 101.0 / 100);
}

TEST(Evaluation, KittiErrorsOfATurn) {
  const KittiErrors errors = kitti_errors(straight_way(150, 0, 0.1));
  ASSERT_EQ(errors.by_length.size(), 1u) << "no 200 m";
  EXPECT_EQ(errors.by_length[0].count, 5u);
  EXPECT_NEAR(errors.mean.rotation_deg_per_100_m, 10.1, 1e-9);
  EXPECT_TRUE(kitti_errors(straight_way(100, 0, 0.1)).by_length.empty()) << "none is beyond 100 m";
  EXPECT_EQ(kitti_errors({}).mean.count, 0u);
}

TEST(Evaluation, AssociatesTheNearestWithinTheLimit) {
  const auto at = [](std::int64_t t_ms) {
    return TimedPose{t_ms * 1'000'000, SE3(SO3(), Vector3(double(t_ms), 0, 0))};
  };
  const auto pairs = associate({at(0), at(9), at(26), at(100)}, {at(2), at(10), at(20), at(33)}, 6'000'000);
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_EQ(pairs[0].T_w_c.translation().x(), 2);
  EXPECT_EQ(pairs[1].T_w_c.translation().x(), 10);
  EXPECT_EQ(pairs[2].T_w_c.translation().x(), 20);
  EXPECT_TRUE(associate({}, {at(2)}, 1).empty());
  EXPECT_TRUE(associate({at(2)}, {}, 1).empty());
}

TEST(Evaluation, Statistics) {
  const auto s = error_statistics({4, 1, 3, 2});
  EXPECT_DOUBLE_EQ(s.mean, 2.5);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.rmse, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(s.stddev, std::sqrt(1.25));
  EXPECT_EQ(s.min, 1);
  EXPECT_EQ(s.max, 4);
  EXPECT_EQ(error_statistics({}).count, 0u);
}

struct Reference {
  const char* estimate;
  const char* truth;
  Alignment alignment;
  std::size_t poses;
  double rmse, mean, max, scale;  ///< 0: not stated
  double rmse_step, mean_step;    ///< of the last printed digit
};

/// Unpacks name.gz into the scratch folder, or returns the plain file.
std::filesystem::path unpacked(const std::filesystem::path& data, const std::string& name,
                               const ScratchFolder& scratch) {
  if (std::filesystem::exists(data / name)) return data / name;
  const auto target = scratch.path() / name;
  const std::string command =
      "gzip -dc '" + (data / (name + ".gz")).string() + "' > '" + target.string() + "'";
  EXPECT_EQ(std::system(command.c_str()), 0);
  return target;
}

/// The estimate's orientations turned, at each of its poses, by some rotation of its camera.
std::vector<PosePair> with_turned_cameras(const std::function<SO3(int)>& turn) {
  std::vector<PosePair> pairs;
  for (const TimedPose& pose : helix(200)) {
    const SO3 R = pose.T_w_c.so3() * turn(static_cast<int>(pairs.size()));
    pairs.push_back({pose.t_ns, SE3(R, pose.T_w_c.translation()), pose.T_w_c});
  }
  return pairs;
}

TEST(Evaluation, ATurnBetweenBodyAndCameraIsTold) {
  const SO3 R_b_c = SO3::exp(Vector3(0, std::numbers::pi / 2, 0));
  const auto turn = constant_turn_deg(with_turned_cameras([&](int) { return R_b_c; }));
  ASSERT_TRUE(turn);
  EXPECT_NEAR(*turn, 90, 1e-9);
  const auto shaky = constant_turn_deg(
      with_turned_cameras([&](int i) { return R_b_c * SO3::exp(Vector3(0.05 * std::sin(i), 0, 0)); }));
  ASSERT_TRUE(shaky);
  EXPECT_NEAR(*shaky, 90, 0.5);
  const auto half =
      constant_turn_deg(with_turned_cameras([](int) { return SO3::exp(Vector3(std::numbers::pi, 0, 0)); }));
  ASSERT_TRUE(half);
  EXPECT_NEAR(*half, 180, 1e-6);
}

TEST(Evaluation, OtherErrorsOfOrientationAreNoConstantTurn) {
  EXPECT_FALSE(constant_turn_deg(with_turned_cameras([](int) { return SO3::exp(Vector3(0, 0.2, 0)); })))
      << "11 degrees: a camera may be mounted so";
  EXPECT_FALSE(constant_turn_deg(with_turned_cameras([](int i) {
    return SO3::exp(Vector3(0, 0.01 * i, 0));
  }))) << "it grows";
  auto world_turned = with_turned_cameras([](int) { return SO3(); });  // as a wrong alignment would
  for (PosePair& pair : world_turned)
    pair.T_e_c = SE3(SO3::exp(Vector3(1, 0, 0)), Vector3::Zero()) * pair.T_e_c;
  EXPECT_FALSE(constant_turn_deg(world_turned)) << "of the world, not of the camera";
  EXPECT_FALSE(constant_turn_deg({}));
}

/// Figures of trajectories_evo/REFERENCE.txt to their printed digits, but for one: the mean of rgbdslam on
/// fr1_xyz is printed there as 0.012025. Horn's quaternion method, programmed apart from this, gives
/// 0.012024498709 as well, 1.3e-9 below what would round to that; 0.0120245 (rounded once more: 0.012025) is
/// what is asked for here.
TEST(Evaluation, AgreesWithReferenceOnPublishedTrajectories) {
  const char* root = std::getenv("TWOFOLD_DATA");
  if (!root) GTEST_SKIP() << "TWOFOLD_DATA is not set";
  const auto data = std::filesystem::path(root) / "trajectories_evo";
  const ScratchFolder scratch;
  const Reference references[] = {
      {"KITTI_00_ORB.txt", "KITTI_00_gt.txt", Alignment::kSe3, 4541, 1.30345, 1.157, 3.588, 0, 1e-5, 1e-3},
      {"KITTI_00_SPTAM.txt", "KITTI_00_gt.txt", Alignment::kSe3, 4541, 3.73849, 3.491, 7.769, 0, 1e-5, 1e-3},
      {"fr2_desk_ORB.txt", "fr2_desk_groundtruth.txt", Alignment::kSe3, 2174, .008119, .007492, .0243, 0,
       1e-6, 1e-6},
      {"fr2_desk_ORB_kf_mono.txt", "fr2_desk_groundtruth.txt", Alignment::kSim3, 118, .007729, 0, 0, 2.2280,
       1e-6, 0},
      {"freiburg1_xyz-rgbdslam.txt", "freiburg1_xyz-groundtruth.txt", Alignment::kSe3, 785, .013470, .0120245,
       .0348, 0, 1e-6, 1e-6},
      {"freiburg1_xyz-ORB_kf_mono.txt", "freiburg1_xyz-groundtruth.txt", Alignment::kSim3, 32, .009755, 0, 0,
       1.1056, 1e-6, 0}};
  for (const Reference& r : references) {
    const auto pairs = associate(read_trajectory(unpacked(data, r.estimate, scratch)),
                                 read_trajectory(unpacked(data, r.truth, scratch)), 10'000'000);
    EvaluationOptions options;
    options.alignment = r.alignment;
    const auto result = evaluate(pairs, options);
    ASSERT_TRUE(result) << r.estimate;
    EXPECT_EQ(result->pairs.size(), r.poses) << r.estimate;
    EXPECT_NEAR(result->absolute.rmse, r.rmse, 0.5 * r.rmse_step) << r.estimate;
    if (r.mean > 0) {
      EXPECT_NEAR(result->absolute.mean, r.mean, 0.5 * r.mean_step) << r.estimate;
    }
    if (r.max > 0) {
      EXPECT_NEAR(result->absolute.max, r.max, r.max < 1 ? 5e-5 : 5e-4) << r.estimate;
    }
    if (r.scale > 0) {
      EXPECT_NEAR(result->S_w_e.scale(), r.scale, 5e-5) << r.estimate;
    }
  }
}

/// ORB-SLAM2's published figures for this sequence are 0.70 % and 0.25 deg/100 m; the digits beyond are those
/// of a program written apart from this, after the development kit's description.
TEST(Evaluation, KittiErrorsAgreeWithPublishedOnes) {
  const char* root = std::getenv("TWOFOLD_DATA");
  if (!root) GTEST_SKIP() << "TWOFOLD_DATA is not set";
  const auto data = std::filesystem::path(root) / "trajectories_evo";
  const ScratchFolder scratch;
  const auto errors_of = [&](const char* estimate) {
    return kitti_errors(associate(read_trajectory(unpacked(data, estimate, scratch)),
                                  read_trajectory(unpacked(data, "KITTI_00_gt.txt", scratch)), 0));
  };
  const KittiErrors orb = errors_of("KITTI_00_ORB.txt");
  EXPECT_EQ(orb.mean.count, 3283u);
  EXPECT_NEAR(orb.mean.translation_percent, 0.699729, 1e-6);
  EXPECT_NEAR(orb.mean.rotation_deg_per_100_m, 0.253323, 1e-6);
  ASSERT_EQ(orb.by_length.size(), 8u);
  EXPECT_EQ(orb.by_length[7].count, 375u);
  EXPECT_NEAR(orb.by_length[7].translation_percent, 0.415861, 1e-6);
  const KittiErrors sptam = errors_of("KITTI_00_SPTAM.txt");
  EXPECT_NEAR(sptam.mean.translation_percent, 1.486961, 1e-6);
  EXPECT_NEAR(sptam.mean.rotation_deg_per_100_m, 0.557706, 1e-6);
}

}  // namespace
}  // namespace twofold
