// A camera that shakes its head before points that are known exactly, each row seen at its own time.
#include "camera/readout_estimator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "fixtures/option_rules.hpp"
#include "tests/allocation_counter.hpp"

namespace twofold {
namespace {

constexpr double kPeriod = 1.0 / 30;
constexpr double kNoisePx = 0.3;

Rig camera_rig() {
  Rig rig;
  rig.camera = {500, 500, 320, 240, 640, 480};
  return rig;
}

enum class Motion {
  kShaken,   ///< turns about all axes, to and fro
  kTurning,  ///< ever on
  kOnAnArm   ///< shaken, and it moves aside the faster the more its turn changes
};

SE3 T_c_w_at(double seconds, Motion motion) {
  const Vector3 turn =
      motion == Motion::kTurning
          ? Vector3(Vector3(0.02, 0.5, 0.01) * seconds)
          : Vector3(0.10 * std::sin(7 * seconds), 0.25 * std::sin(5 * seconds), 0.08 * std::sin(9 * seconds));
  const double aside = motion == Motion::kOnAnArm ? -std::cos(5 * seconds) : std::sin(3 * seconds);
  return SE3(SO3::exp(turn), Vector3(0.1 * aside, 0, 0.05 * seconds)).inverse();
}

class ShakenCamera {
 public:
  explicit ShakenCamera(double readout, unsigned seed = 5) : readout_(readout), random_(seed) {
    std::uniform_real_distribution<double> angle(-M_PI, M_PI), height(-2, 2), distance(1.5, 5);
    for (int i = 0; i < 1500; ++i) {
      const double a = angle(random_), d = distance(random_);
      points_.emplace_back(d * std::sin(a), height(random_), d * std::cos(a));
    }
  }
  double period = kPeriod;  ///< of its frames [s]
  double stamp_jitter = 0;  ///< share of the period by which time stamps are wrong
  Motion motion = Motion::kShaken;
  double unit = 1;         ///< [m]: of one camera's map any length
  double bend = 0;         ///< of inverse depths, a share by which the last row's exceed the first row's
  double depth_error = 0;  ///< of which the estimator is told

  void show(int frame, ReadoutEstimator& estimator) {
    const double t = frame * period;
    std::uniform_real_distribution<double> jitter(-stamp_jitter, stamp_jitter);
    SE3 T_cur_prev = T_c_w_at(t, motion) * T_c_w_at(t - period, motion).inverse();
    T_cur_prev.translation() /= unit;
    const auto t_ns = static_cast<std::int64_t>((t + jitter(random_) * period + 1) * 1e9);
    std::vector<ReadoutPoint>* seen = estimator.begin_frame(t_ns, T_cur_prev);
    if (seen == nullptr) return;
    for (std::size_t p = 0; p < points_.size() && seen->size() < seen->capacity(); ++p) see(p, t, *seen);
    estimator.end_frame();
  }
  [[nodiscard]] ReadoutEstimate after(int frames, const ReadoutOptions& options = {}) {
    ReadoutEstimator estimator(rig_, 150, options);
    for (int i = 0; i < frames; ++i) show(i, estimator);
    return estimator.estimate();
  }

 private:
  void see(std::size_t p, double t, std::vector<ReadoutPoint>& seen) {
    Vector3 x = T_c_w_at(t, motion) * points_[p];
    for (int round = 0; round < 4; ++round) {
      if (!(x.z() > 0.3)) return;
      const double v = rig_.camera.project(x).y();
      x = T_c_w_at(t + ((v + 0.5) / rig_.camera.height - 0.5) * readout_, motion) * points_[p];
    }
    if (!(x.z() > 0.3) || !rig_.camera.find_in_view(x, 8)) return;
    std::normal_distribution<double> noise(0, 1);
    const Vector2 uv = rig_.camera.project(x) + kNoisePx * Vector2(noise(random_), noise(random_));
    const double bent = 1 + bend * ((uv.y() + 0.5) / rig_.camera.height - 0.5);
    seen.push_back({p + 1, uv, x.z() / unit * (1 + 0.01 * noise(random_)) / bent, 0.5, depth_error});
  }

  const Rig rig_ = camera_rig();
  double readout_;
  std::mt19937 random_;
  std::vector<Vector3> points_;
};

class ReadoutOfACamera : public ::testing::TestWithParam<double> {};

TEST_P(ReadoutOfACamera, IsFound) {
  const double readout = GetParam();
  const ReadoutEstimate found = ShakenCamera(readout).after(60);
  EXPECT_GE(found.pairs, 20);
  EXPECT_LT(found.sigma, 0.0015);
  EXPECT_NEAR(found.seconds, readout, 4 * found.sigma);
  EXPECT_EQ(found.significant, readout > 0);
}

TEST_P(ReadoutOfACamera, IsFoundThoughTimeStampsJitter) {
  const double readout = GetParam();
  ShakenCamera camera(readout);
  camera.stamp_jitter = 0.17;
  const ReadoutEstimate found = camera.after(60);
  EXPECT_NEAR(found.seconds, readout, 0.1 * readout + 0.001);
  EXPECT_EQ(found.significant, readout > 0);
}

INSTANTIATE_TEST_SUITE_P(Readouts, ReadoutOfACamera, ::testing::Values(0, 0.010, 0.026, 0.033));

/// A drone that started at 200 m hovers near the ground: what it sees is a hundredth of a unit away.
TEST(ReadoutEstimator, TheUnitOfLengthDoesNotMatter) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    ShakenCamera metric(0.026, seed), drone(0.026, seed);
    drone.unit = 200;
    const ReadoutEstimate expected = metric.after(60), found = drone.after(60);
    EXPECT_EQ(found.pairs, expected.pairs) << seed;
    EXPECT_NEAR(found.seconds, expected.seconds, 1e-9) << seed;
    EXPECT_NEAR(found.sigma, expected.sigma, 1e-9) << seed;
  }
}

/// What is mapped before stays bent.
TEST(ReadoutEstimator, IsBelievedSoon) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    ShakenCamera camera(0.026, seed);
    camera.stamp_jitter = 0.17;
    const ReadoutEstimate found = camera.after(20);
    EXPECT_TRUE(found.significant) << seed;
    EXPECT_NEAR(found.seconds, 0.026, 0.005) << seed;
  }
}

/// At no time, and time stamps that jitter look like turns that change.
TEST(ReadoutEstimator, DoesNotBelieveAnythingOfAGlobalShutter) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    ShakenCamera camera(0, seed);
    camera.stamp_jitter = 0.17;
    ReadoutEstimator estimator(camera_rig(), 150);
    for (int i = 0; i < 90; ++i) {
      camera.show(i, estimator);
      ASSERT_FALSE(estimator.estimate().significant) << "seed " << seed << ", frame " << i;
    }
  }
}

/// At 6 frames a second central differences miss a fifth of how it turns; 20 ms were taken for 26.
TEST(ReadoutEstimator, FewFramesASecondMakeItNoLonger) {
  constexpr unsigned kSeeds = 12;
  double mean = 0;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    ShakenCamera camera(0.020, seed);
    camera.period = 1.0 / 6;
    const ReadoutEstimate found = camera.after(90);
    EXPECT_TRUE(found.significant) << seed;
    mean += found.seconds / kSeeds;
  }
  EXPECT_NEAR(mean, 0.020, 0.002);
}

/// It turns back between one frame and the next: how it moves while rows are read nobody knows.
TEST(ReadoutEstimator, LearnsLittleFromTurnsThatFramesDoNotFollow) {
  ShakenCamera careful(0.020), careless(0.020);
  careful.period = careless.period = 0.3;
  const int pairs = careful.after(90).pairs;
  EXPECT_LT(2 * pairs, careless.after(90, {.max_missed_share = 1}).pairs);
}

TEST(ReadoutEstimator, LearnsNothingFromATurnThatStaysTheSame) {
  ShakenCamera camera(0.026);
  camera.motion = Motion::kTurning;
  const ReadoutEstimate found = camera.after(60);
  EXPECT_EQ(found.pairs, 0);
  EXPECT_FALSE(found.significant);
}

/// A map that is bent one way and the other. Depths that are believed turn into a readout.
TEST(ReadoutEstimator, IsNotDeceivedByDepthsThatNobodyMeasured) {
  constexpr unsigned kSeeds = 12;
  const auto found_with = [](double bend, double depth_error, unsigned seed) {
    ShakenCamera camera(0.026, seed);
    camera.motion = Motion::kOnAnArm;
    camera.bend = bend;
    camera.depth_error = depth_error;
    return camera.after(90);
  };
  double believed = 0, weighed = 0;  // means: by how much two bent maps differ
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    believed += (found_with(0.5, 0, seed).seconds - found_with(-0.5, 0, seed).seconds) / kSeeds;
    const ReadoutEstimate one_way = found_with(-0.5, 5, seed), other_way = found_with(0.5, 5, seed);
    weighed += (other_way.seconds - one_way.seconds) / kSeeds;
    for (const ReadoutEstimate& found : {one_way, other_way}) {
      EXPECT_TRUE(found.significant) << seed;
      EXPECT_NEAR(found.seconds, 0.026, 4 * found.sigma) << seed;
    }
  }
  EXPECT_GT(std::abs(believed), 0.006);
  EXPECT_LT(std::abs(weighed), 0.004);
}

TEST(ReadoutEstimator, NeedsFramesThatFollowEachOther) {
  ShakenCamera camera(0.026);
  ReadoutEstimator lost(camera_rig(), 150), dropped(camera_rig(), 150);
  for (int i = 0; i < 60; ++i) {
    if (i % 3 == 0) lost.interrupt();
    camera.show(i, lost);
    if (i < 12 || i % 4 != 0) camera.show(i, dropped);  // at first, all: it learns the period
  }
  EXPECT_EQ(lost.estimate().pairs, 0);
  EXPECT_LT(dropped.estimate().pairs, 12);
}

TEST(ReadoutEstimator, IsDoneWhenItKnows) {
  ShakenCamera camera(0.026);
  ReadoutEstimator estimator(camera_rig(), 150);
  for (int i = 0; i < 150; ++i) camera.show(i, estimator);
  ASSERT_TRUE(estimator.estimate().significant);
  EXPECT_EQ(estimator.begin_frame(std::int64_t{100'000'000'000}, SE3()), nullptr);
}

TEST(ReadoutEstimator, BelievesAndEndsAsTheOptionsSay) {
  ShakenCamera camera(0.026);
  ReadoutEstimator usual(camera_rig(), 150), careful(camera_rig(), 150, {.min_pairs = 45});
  ReadoutEstimator brief(camera_rig(), 150, {.pairs_to_give_up = 10});
  for (int i = 0; i < 40; ++i) {
    camera.show(i, usual);
    camera.show(i, careful);
    camera.show(i, brief);
  }
  EXPECT_TRUE(usual.estimate().significant);
  EXPECT_FALSE(careful.estimate().significant);
  EXPECT_EQ(brief.estimate().pairs, 10);
  for (int i = 40; i < 120; ++i) camera.show(i, careful);
  EXPECT_TRUE(careful.estimate().significant);
}

TEST(ReadoutOptionsTest, SayWhyTheyAreInvalid) {
  testing::expect_rules<ReadoutOptions>({{"min_points", [](auto& o) { o.min_points = 5; }},
                                         {"max_jitter", [](auto& o) { o.max_jitter = 0; }},
                                         {"min_pairs", [](auto& o) { o.min_pairs = 0; }},
                                         {"significant_sigmas", [](auto& o) { o.significant_sigmas = 0; }},
                                         {"exact_enough", [](auto& o) { o.exact_enough = 0; }}});
}

TEST(ReadoutEstimator, AllocatesNothing) {
  ShakenCamera camera(0.001);
  ReadoutEstimator estimator(camera_rig(), 150);
  camera.show(0, estimator);
  const std::uint64_t before = testing::allocations();
  for (int i = 1; i < 40; ++i) camera.show(i, estimator);
  EXPECT_EQ(testing::allocations(), before);
  EXPECT_GT(estimator.estimate().pairs, 10);
}

}  // namespace
}  // namespace twofold
