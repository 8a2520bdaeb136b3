#include "tracking/monocular/first_structure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <utility>

#include "fixtures/rendered_scene.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

using testing::test_rig;

/// Points of a scene, and where the camera is from the first to the last frame, s in [0, 1].
struct Setting {
  std::function<Vector3(int i, double s)> point;
  std::function<SE3(double s)> T_c_first;
};

/// Corners with half a pixel of noise; one in ten follows something else.
CornerViews views_of(const Setting& setting, std::uint32_t seed, int corners = 160) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> noise(0, 0.4);
  std::uniform_real_distribution<double> unit(-1, 1);
  const Rig rig = test_rig(SensorKind::kMono);
  const auto seen = [&](int i, double s) -> Vector2 {
    return rig.camera.project(setting.T_c_first(s) * setting.point(i, s)) + Vector2(noise(rng), noise(rng));
  };
  constexpr double kBetween[] = {0.3, 0.6, 0.9};
  CornerViews views;
  views.between.resize(std::size(kBetween));
  for (int i = 0; i < corners; ++i) {
    const Vector2 astray = i % 10 == 0 ? Vector2(40 * unit(rng), 40 * unit(rng)) : Vector2::Zero();
    views.first.push_back(seen(i, 0));
    for (std::size_t b = 0; b < views.between.size(); ++b)
      views.between[b].push_back(seen(i, kBetween[b]) + kBetween[b] * astray);
    views.last.push_back(seen(i, 1) + astray);
  }
  return views;
}

/// The same of ten frames, from a camera whose readout nobody knows.
CornerViews views_through_some_shutter(const Setting& setting, std::uint32_t seed) {
  CornerViews views = views_of(setting, seed);
  const Rig rig = test_rig(SensorKind::kMono);
  for (std::size_t n = 0; n < views.first.size(); ++n) {
    const int i = static_cast<int>(n);
    const auto seen = [&](double s) -> Vector2 {
      return rig.camera.project(setting.T_c_first(s) * setting.point(i, s));
    };
    views.first_motion.push_back(seen(0.1) - seen(0));
    views.last_motion.push_back(seen(1) - seen(0.9));
  }
  return views;
}

/// Spread over the image, at depths from 3 to 12.
Vector3 scattered(int i, double) {
  std::mt19937 rng(static_cast<std::uint32_t>(7 * i + 1));
  std::uniform_real_distribution<double> unit(-1, 1);
  const double depth = 7.5 + 4.5 * unit(rng);
  return depth * Vector3(0.5 * unit(rng), 0.35 * unit(rng), 1);
}

Vector3 on_a_plane(int i, double s) {
  const Vector3 ray = scattered(i, s) / scattered(i, s).z();
  return ray * 6 / (1 + 0.4 * ray.x() - 0.2 * ray.y());
}

std::function<SE3(double)> moving(const Vector3& t, const Vector3& w) {
  return [=](double s) { return SE3::exp(s * (Vector6() << t, w).finished()); };
}

const Rig kRig = test_rig(SensorKind::kMono);

void expect_start(const Setting& setting, const char* what) {
  for (std::uint32_t seed = 1; seed <= 5; ++seed) {
    const auto start = first_structure(kRig, views_of(setting, seed), {});
    ASSERT_TRUE(start) << what << ", " << seed << ": " << describe(start.error());
    const SE3 truth = setting.T_c_first(1);
    EXPECT_LT((start->T_last_first.so3().inverse() * truth.so3()).log().norm(), 0.012) << what << seed;
    EXPECT_LT((start->T_last_first.translation().normalized() - truth.translation().normalized()).norm(),
              0.12)
        << what << seed;
    // Ratios of depths are those of the scene.
    std::vector<double> ratios, depths;
    for (std::size_t n = 0; n < start->corners.size(); ++n) {
      depths.push_back(1 / start->psi[n].z());
      ratios.push_back(depths.back() / setting.point(start->corners[n], 0).z());
    }
    std::sort(ratios.begin(), ratios.end());
    std::sort(depths.begin(), depths.end());
    EXPECT_NEAR(depths[depths.size() / 2], 1, 1e-9);
    EXPECT_LT(ratios[ratios.size() * 3 / 4] / ratios[ratios.size() / 4], 1.25) << what << seed;
  }
}

void expect_wait(const Setting& setting, LostCause cause, const char* what) {
  for (std::uint32_t seed = 1; seed <= 5; ++seed) {
    const auto start = first_structure(kRig, views_of(setting, seed), {});
    ASSERT_FALSE(start) << what << seed;
    EXPECT_EQ(start.error(), cause) << what << seed << ": " << describe(start.error());
  }
}

TEST(FirstStructure, StartsWhateverTheDirectionOfMotion) {
  expect_start({scattered, moving({-0.6, 0, 0}, {0, 0, 0})}, "sideways");
  expect_start({scattered, moving({-0.6, 0.1, 0.1}, {0.02, 0.08, -0.03})}, "turning");
  expect_start({scattered, moving({0, 0, -1.4}, {0, 0.01, 0})}, "forward");
}

TEST(FirstStructure, StartsOnAPlaneWhenOneMotionAloneExplainsIt) {
  expect_start({on_a_plane, moving({-2.0, 0.4, -1.4}, {0, 0.08, 0})}, "plane");
}

/// Two motions explain a plane. The farther the camera has gone, the less the second one fits what was seen
/// on the way.
TEST(FirstStructure, IsNotDeceivedByAPlane) {
  const Vector3 directions[] = {
      {-1, 0, 0}, {0, -1, 0.2}, {-0.8, 0.2, -0.5}, {0.3, 0.2, -0.9}, {0.6, -0.6, 0.4}};
  for (const double length : {0.3, 0.6, 1.0, 1.5, 2.5}) {
    int starts = 0, wrong = 0, undecided = 0;
    for (const Vector3& direction : directions) {
      const Setting setting{on_a_plane, moving(length * direction, length * Vector3(0.01, 0.04, 0))};
      for (std::uint32_t seed = 1; seed <= 6; ++seed) {
        const auto start = first_structure(kRig, views_of(setting, seed), {});
        starts += start.has_value();
        undecided += !start && start.error() == LostCause::kPlaneUndecided;
        if (!start) continue;
        const Vector3 way = setting.T_c_first(1).translation().normalized();
        wrong += (start->T_last_first.translation().normalized() - way).norm() > 0.2;
      }
    }
    EXPECT_EQ(wrong, 0) << length;
    if (length < 1) {
      EXPECT_GT(undecided, 8) << length;
    }
    if (length > 2) {
      EXPECT_GT(starts, 24) << length;
    }
  }
}

/// Giving motions up early changes no decision.
TEST(FirstStructure, GivesUpEarlyOnlyWhatCannotWin) {
  FirstStructureOptions patient;
  patient.hopeless_ratio = 1e9;
  for (const double length : {0.3, 0.6, 1.0, 1.5, 2.5}) {
    const Setting setting{on_a_plane, moving({-length, 0.2 * length, -0.5 * length}, {0, 0.03, 0})};
    for (std::uint32_t seed = 1; seed <= 8; ++seed) {
      const CornerViews views = views_of(setting, seed);
      const auto early = first_structure(kRig, views, {}), late = first_structure(kRig, views, patient);
      ASSERT_EQ(early.has_value(), late.has_value()) << length << ", " << seed;
      if (early) {
        EXPECT_EQ(early->corners, late->corners) << length << ", " << seed;
      } else {
        EXPECT_EQ(early.error(), late.error()) << length << ", " << seed;
      }
    }
  }
}

TEST(FirstStructure, WaitsWhileTheCameraStandsOrTurnsOnTheSpot) {
  expect_wait({scattered, moving({0, 0, 0}, {0, 0, 0})}, LostCause::kTooLittleParallax, "standing");
  expect_wait({scattered, moving({0, 0, 0}, {0.03, 0.12, 0})}, LostCause::kRotatingOnly, "turning");
  expect_wait({scattered, moving({-0.02, 0, 0}, {0.03, 0.12, 0})}, LostCause::kRotatingOnly,
              "turning, nearly");
}

TEST(FirstStructure, StartsThoughTheReadoutIsNotKnown) {
  const std::pair<const char*, Setting> settings[] = {
      {"sideways", {scattered, moving({-0.6, 0, 0}, {0, 0, 0})}},
      {"turning", {scattered, moving({-0.6, 0.1, 0.1}, {0.02, 0.08, -0.03})}},
      {"forward", {scattered, moving({0, 0, -1.4}, {0, 0.01, 0})}},
      {"plane", {on_a_plane, moving({-2.0, 0.4, -1.4}, {0, 0.08, 0})}}};
  for (const auto& [what, setting] : settings) {
    for (std::uint32_t seed = 1; seed <= 5; ++seed) {
      const auto start = first_structure(kRig, views_through_some_shutter(setting, seed), {});
      EXPECT_TRUE(start) << what << seed << ": " << describe(start.error());
    }
  }
}

/// Corners as a camera follows them that pans on the spot, to and fro in 24 frames: from when it turns
/// fastest one way until it turns back. Its rows take a share of the time between frames to be read.
CornerViews panned_views(double share, std::uint32_t seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> noise(0, 0.4);
  const PinholeCamera& camera = kRig.camera;
  const auto seen = [&](int i, double frame) -> Vector2 {
    Vector2 uv(0, 0.5 * camera.height);
    for (int n = 0; n < 10; ++n) {
      const double tau = (uv.y() + 0.5) / camera.height - 0.5;
      const double angle = 0.1 * std::sin(2 * M_PI * (frame + share * tau) / 24);
      uv = camera.project(SO3::exp(Vector3(0, angle, 0)) * scattered(i, 0));
    }
    return uv + Vector2(noise(rng), noise(rng));
  };
  CornerViews views;
  views.between.resize(2);
  for (int i = 0; i < 160; ++i) {
    views.first.push_back(seen(i, 0));
    views.first_motion.push_back(seen(i, 1) - views.first.back());
    views.between[0].push_back(seen(i, 3));
    views.between[1].push_back(seen(i, 6));
    views.last.push_back(seen(i, 9));
    views.last_motion.push_back(views.last.back() - seen(i, 8));
  }
  return views;
}

TEST(FirstStructure, IsNotDeceivedByARollingShutterThatPans) {
  for (const double share : {0.5, 0.7, 0.9}) {
    for (std::uint32_t seed = 1; seed <= 5; ++seed) {
      CornerViews views = panned_views(share, seed);
      const auto start = first_structure(kRig, views, {});
      ASSERT_FALSE(start) << share << ' ' << seed;
      EXPECT_EQ(start.error(), LostCause::kRotatingOnly) << describe(start.error());
      // Who takes them for a global shutter's sees no rotation.
      views.first_motion.clear();
      views.last_motion.clear();
      const auto deceived = first_structure(kRig, views, {});
      EXPECT_TRUE(deceived || deceived.error() != LostCause::kRotatingOnly) << share << ' ' << seed;
    }
  }
}

TEST(FirstStructure, WaitsForTheFlowThatIsAskedFor) {
  const CornerViews views = views_of({scattered, moving({-0.6, 0, 0}, {0, 0, 0})}, 1);
  FirstStructureOptions options;
  ASSERT_TRUE(first_structure(kRig, views, options));
  options.min_flow_px = 100;
  const auto start = first_structure(kRig, views, options);
  ASSERT_FALSE(start);
  EXPECT_EQ(start.error(), LostCause::kTooLittleParallax);
}

/// Nine corners in ten follow one motion.
TEST(FirstStructure, WantsMostCornersToAgree) {
  const CornerViews views = views_of({scattered, moving({-0.6, 0, 0}, {0, 0, 0})}, 1);
  FirstStructureOptions options;
  options.min_share = 0.8;
  ASSERT_TRUE(first_structure(kRig, views, options));
  options.min_share = 0.95;
  const auto start = first_structure(kRig, views, options);
  ASSERT_FALSE(start);
  EXPECT_EQ(start.error(), LostCause::kNoCommonMotion);
}

/// Every third corner is on the horizon: it agrees with the motion, and knows no depth. (That it moves at all
/// tells it from the background of a camera that stands.)
TEST(FirstStructure, PointsWithoutADepthDoNotJoin) {
  const auto before_a_horizon = [](int i, double s) {
    return Vector3((i % 3 == 0 ? 1000 : 1) * scattered(i, s));
  };
  const auto start =
      first_structure(kRig, views_of({before_a_horizon, moving({-0.6, 0, 0}, {0, 0.02, 0})}, 1), {});
  ASSERT_TRUE(start) << describe(start.error());
  EXPECT_GT(start->corners.size(), 60U);
  for (const int corner : start->corners) {
    const bool astray = corner % 10 == 0;  // it may go as something near would
    EXPECT_TRUE(corner % 3 != 0 || astray) << corner;
  }
}

TEST(FirstStructure, IsNotStartedBySomethingThatMoves) {
  const auto passing = [](int i, double s) {
    return Vector3(scattered(i, s) + (i % 3 == 0 ? s * Vector3(0.8, 0, 0) : Vector3(0, 0, 0)));
  };
  const auto start = first_structure(kRig, views_of({passing, moving({0, 0, 0}, {0, 0, 0})}, 1), {});
  ASSERT_FALSE(start);
  // Not even while the camera turns.
  const auto turning = first_structure(kRig, views_of({passing, moving({0, 0, 0}, {0, 0.1, 0})}, 1), {});
  ASSERT_FALSE(turning);
}

/// It hides seven tenths or more of the view, and alone gives a structure that is as good as any.
TEST(FirstStructure, IsNotStartedByWhatHidesMostOfTheView) {
  const std::function<SE3(double)> itself[] = {moving({-0.6, 0, 0}, {0, 0, 0}),
                                               moving({-0.6, 0.1, 0.1}, {0.02, 0.08, -0.03}),
                                               moving({0.1, 0, -1.4}, {0, 0.01, 0})};
  for (const double hidden : {0.7, 0.8}) {
    for (const auto& motion : itself) {
      const auto point = [&](int i, double s) {
        const Vector3 p = scattered(i, s);
        return Vector3(p.x() / p.z() < hidden - 0.5 ? motion(s) * p : p);
      };
      expect_wait({point, moving({0, 0, 0}, {0, 0, 0})}, LostCause::kNoCommonMotion, "hidden");
    }
  }
}

/// Along the lower border, where a camera sees the bonnet of its own car.
TEST(FirstStructure, StartsDespiteWhatMovesWithTheCamera) {
  const auto motion = moving({-0.6, 0.1, 0.1}, {0.02, 0.08, -0.03});
  const auto point = [&](int i, double s) {
    const Vector3 p = scattered(i, s);
    return Vector3(p.y() / p.z() > 0.2 ? motion(s).inverse() * p : p);
  };
  for (std::uint32_t seed = 1; seed <= 5; ++seed)
    EXPECT_TRUE(first_structure(kRig, views_of({point, motion}, seed), {})) << seed;
}

TEST(FirstStructure, NeedsCorners) {
  const auto start = first_structure(kRig, views_of({scattered, moving({-0.6, 0, 0}, {0, 0, 0})}, 1, 30), {});
  ASSERT_FALSE(start);
  EXPECT_EQ(start.error(), LostCause::kTooFewCorners);
}

}  // namespace
}  // namespace twofold
