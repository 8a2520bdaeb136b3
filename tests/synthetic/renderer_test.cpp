#include "synthetic/renderer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <random>

#include "synthetic/camera_path.hpp"
#include "synthetic/furniture.hpp"
#include "synthetic/random.hpp"
#include "synthetic/scenes.hpp"

namespace twofold::synthetic {
namespace {

const PinholeCamera kCamera{300, 310, 159.5, 119.5, 320, 240};

cv::Mat grey(int width, int height, float value) {
  return cv::Mat(height, width, CV_32FC1, cv::Scalar(value));
}

Vector3 world_point(const View& view, const SE3& T_w_c, int u, int v) {
  const double w = view.inverse_depth.at<float>(v, u);
  return T_w_c * Vector3(kCamera.unproject(Vector2(u, v)) / w);
}

float sample_alone(const Texture& texture, float u, float v, const TexelFootprint& footprint) {
  TexturePoints points;
  for (int k = 0; k < TexturePoints::kSize; ++k) points.set(k, u, v, footprint);
  return texture.sample(points)[0];
}

TEST(Renderer, QuadHasTheDepthOfItsPlaneAndItsOutline) {
  Scene scene;
  const int texture = scene.add(grey(64, 64, 100));
  // One metre square, two metres along +x; seen with y to the left and z up.
  scene.quads.push_back({{2, 0.5, 0.5}, -Vector3::UnitY(), -Vector3::UnitZ(), 1, 1, texture, 1});
  const SE3 T_w_c = looking({0.1, 0.05, -0.1}, 0.2, 0.1, 0.05);
  const View view = Renderer(scene).render(kCamera, T_w_c);
  int hits = 0;
  for (int v = 0; v < kCamera.height; ++v) {
    for (int u = 0; u < kCamera.width; ++u) {
      // The plane x = 2 met by the ray, in double.
      const Vector3 ray = T_w_c.so3() * kCamera.unproject(Vector2(u, v));
      const double depth = (2 - T_w_c.translation().x()) / ray.x();
      const Vector3 hit = T_w_c.translation() + depth * ray;
      const double inside = 0.5 - std::max(std::abs(hit.y()), std::abs(hit.z()));
      const float w = view.inverse_depth.at<float>(v, u);
      if (std::abs(inside) < 1e-4) continue;
      ASSERT_EQ(w > 0, inside > 0) << u << ' ' << v;
      if (inside < 0) continue;
      ++hits;
      ASSERT_NEAR(1 / w, depth, 1e-5 * depth);
      if (inside > 0.02) {
        ASSERT_NEAR(view.intensity.at<float>(v, u), 100, 1e-3);
      }
    }
  }
  EXPECT_GT(hits, 5000);
}

/// Of one row, in grey levels or in inverse depth [1/m], whichever is more.
double worst_difference(const View& rows, const View& whole, int row) {
  const double grey = cv::norm(rows.intensity.row(row), whole.intensity.row(row), cv::NORM_INF);
  return std::max(grey, cv::norm(rows.inverse_depth.row(row), whole.inverse_depth.row(row), cv::NORM_INF));
}

/// Quads, cylinders, spheres and rims; a height field; something that moves.
TEST(Renderer, EachRowIsWhatAWholeViewOfItsInstantShows) {
  const Staging desk = make_desk(3), descent = make_descent(3);
  for (const Staging* staging : {&desk, &descent}) {
    const auto instant_of = [&](int row) {
      Instant instant{staging->path(4 + 0.002 * row), {}};
      if (staging->T_w_object)
        instant.extra =
            box_quads(staging->T_w_object(4 + 0.002 * row), staging->object_size, staging->object_texture);
      return instant;
    };
    const Renderer renderer(staging->scene);
    const View rows = renderer.render_rows(kCamera, instant_of);
    const Instant first = instant_of(0);
    const View from_first = renderer.render(kCamera, first.T_w_c, first.extra);
    for (const int row : {0, 1, 57, 120, 238, 239}) {
      const Instant instant = instant_of(row);
      const View whole = renderer.render(kCamera, instant.T_w_c, instant.extra);
      EXPECT_LT(worst_difference(rows, whole, row), 1e-3) << row;
      if (row > 50) {
        EXPECT_GT(worst_difference(rows, from_first, row), 1) << row;
      }
    }
  }
}

TEST(Renderer, BackOfAQuadIsNotSeen) {
  Scene scene;
  const int texture = scene.add(grey(8, 8, 100));
  scene.quads.push_back({{2, -5, 5}, Vector3::UnitY(), -Vector3::UnitZ(), 10, 10, texture, 1});
  const View view = Renderer(scene).render(kCamera, looking({0, 0, 0}, 0, 0, 0));
  EXPECT_EQ(cv::countNonZero(view.inverse_depth), 0);
}

TEST(Renderer, CurvedSurfacesAreMetWhereTheirEquationsSay) {
  Scene scene;
  Random random(4);
  const auto plain = [](Canvas&) {};
  add_cylinder(scene, {3, 0.6, -1}, 0.3, 2, 0.02, plain);
  add_ball(scene, {2.5, -0.5, 0.1}, 0.4, 0.02, plain);
  const SE3 T_w_c = looking({0, 0, 0.2}, 0.05, -0.05, 0.1);
  const View view = Renderer(scene).render(kCamera, T_w_c);
  int on_cylinder = 0;
  int on_ball = 0;
  for (int v = 0; v < kCamera.height; ++v) {
    for (int u = 0; u < kCamera.width; ++u) {
      if (view.inverse_depth.at<float>(v, u) == 0) continue;
      const Vector3 p = world_point(view, T_w_c, u, v);
      const Vector3 view_ray = p - T_w_c.translation();
      const double cylinder = std::hypot(p.x() - 3, p.y() - 0.6) - 0.3;
      const double ball = (p - Vector3(2.5, -0.5, 0.1)).norm() - 0.4;
      ASSERT_LT(std::min(std::abs(cylinder), std::abs(ball)), 1e-4);
      if (std::abs(ball) < 1e-4) {
        ++on_ball;
        EXPECT_LT(view_ray.dot(p - Vector3(2.5, -0.5, 0.1)), 1e-3);  // the near side
      } else {
        ++on_cylinder;
        EXPECT_GE(p.z(), -1 - 1e-4);
        EXPECT_LE(p.z(), 1 + 1e-4);
      }
    }
  }
  EXPECT_GT(on_cylinder, 3000);
  EXPECT_GT(on_ball, 3000);
}

TEST(Renderer, HeightFieldIsMetOnItsSurface) {
  const Staging staging = make_descent(3);
  const PinholeCamera camera{600, 600, 159.5, 119.5, 320, 240};
  const SE3 T_w_c = staging.path(3);
  const View view = Renderer(staging.scene).render(camera, T_w_c);
  for (int v = 0; v < camera.height; v += 3) {
    for (int u = 0; u < camera.width; u += 3) {
      const double w = view.inverse_depth.at<float>(v, u);
      ASSERT_GT(w, 0);
      const Vector3 p = T_w_c * Vector3(camera.unproject(Vector2(u, v)) / w);
      EXPECT_NEAR(staging.scene.height_fields[0].height_at(p.x(), p.y()), p.z(), 5e-5);
    }
  }
}

TEST(Renderer, RimPixelIsTheMeanOverItsArea) {
  Scene scene;
  scene.sky_zenith = scene.sky_horizon = 0;
  const int texture = scene.add(grey(16, 16, 200));
  // The left rim at u = 159.5 + 300 * 0.1 / 2 + shift, straight up.
  for (const double shift : {-0.4, -0.2, 0.0, 0.3}) {
    scene.quads.clear();
    const double y = -2 * (15 + shift) / kCamera.fx;
    scene.quads.push_back({{2, y, 5}, -Vector3::UnitY(), -Vector3::UnitZ(), 10, 10, texture, 1});
    const View view = Renderer(scene).render(kCamera, looking({0, 0, 0}, 0, 0, 0));
    // The rim is at 174.5 + shift; pixel 174 covers [173.5, 174.5], pixel 175 [174.5, 175.5].
    const double cover = view.intensity.at<float>(100, 174) / 200 + view.intensity.at<float>(100, 175) / 200;
    EXPECT_NEAR(cover, 1 - shift, 0.07) << shift;
  }
}

TEST(Texture, PyramidKeepsTheMeanAndHidesWhatIsTooFine) {
  cv::Mat board(256, 256, CV_32FC1);
  for (int y = 0; y < board.rows; ++y)
    for (int x = 0; x < board.cols; ++x) board.at<float>(y, x) = (x + y) % 2 == 0 ? 40.0f : 180.0f;
  const Texture texture(board);
  for (float angle = 0; angle < 3; angle += 0.4f) {
    const float c = std::cos(angle);
    const float s = std::sin(angle);
    for (const float squeeze : {1.0f, 3.0f, 6.0f}) {
      const TexelFootprint footprint{4 * squeeze * c, -4 * s, 4 * squeeze * s, 4 * c};
      for (float u = 100; u < 110; u += 0.37f)
        EXPECT_NEAR(sample_alone(texture, u, 90.3f, footprint), 110, 1.0);
    }
  }
}

TEST(Texture, EightPlacesAreSampledAsEachIsAlone) {
  std::mt19937 rng(4);
  std::uniform_real_distribution<float> grey(0, 255), place(-20, 150), width(-6, 6);
  cv::Mat noise(96, 128, CV_32FC1);
  for (int y = 0; y < noise.rows; ++y)
    for (int x = 0; x < noise.cols; ++x) noise.at<float>(y, x) = grey(rng);
  const Texture texture(noise);
  for (int trial = 0; trial < 500; ++trial) {
    std::array<TexelFootprint, TexturePoints::kSize> footprints;
    TexturePoints points;
    for (int k = 0; k < TexturePoints::kSize; ++k) {
      footprints[static_cast<std::size_t>(k)] = {width(rng), width(rng), width(rng), width(rng)};
      points.set(k, place(rng), place(rng), footprints[static_cast<std::size_t>(k)]);
    }
    const TexturePoints::Floats together = texture.sample(points);
    for (int k = 0; k < TexturePoints::kSize; ++k)
      ASSERT_EQ(together[k],
                sample_alone(texture, points.u[k], points.v[k], footprints[static_cast<std::size_t>(k)]))
          << trial;
  }
}

TEST(Texture, InterpolatesBetweenTexels) {
  cv::Mat ramp(8, 64, CV_32FC1);
  for (int y = 0; y < ramp.rows; ++y)
    for (int x = 0; x < ramp.cols; ++x) ramp.at<float>(y, x) = static_cast<float>(3 * x + 10);
  const Texture texture(ramp);
  const TexelFootprint close{0.3f, 0, 0, 0.3f};
  for (float u = 1; u < 60; u += 0.31f) EXPECT_NEAR(sample_alone(texture, u, 4.2f, close), 3 * u + 10, 1e-2);
  const TexelFootprint slanted{6, 0, 0, 0.8f};  // probes along u are centred
  for (float u = 8; u < 50; u += 0.31f) EXPECT_NEAR(sample_alone(texture, u, 4.2f, slanted), 3 * u + 10, 0.5);
}

TEST(CameraPath, LookingAlongXHasImageAxesRightAndDown) {
  const SE3 T_w_c = looking({1, 2, 3}, 0, 0, 0);
  EXPECT_LT((T_w_c * Vector3(0, 0, 1) - Vector3(2, 2, 3)).norm(), 1e-12);
  EXPECT_LT((T_w_c * Vector3(1, 0, 0) - Vector3(1, 1, 3)).norm(), 1e-12);
  EXPECT_LT((T_w_c * Vector3(0, 1, 0) - Vector3(1, 2, 2)).norm(), 1e-12);
  EXPECT_GT((looking({0, 0, 0}, 0, 0.1, 0) * Vector3(0, 0, 1)).z(), 0.09);  // pitch > 0 looks up
}

TEST(CameraPath, ClosedCurveIsWalkedAtConstantSpeedAndCloses) {
  const ClosedCurve curve({{0, 0}, {4, 0}, {6, 3}, {4, 6}, {0, 6}, {-1, 3}});
  EXPECT_LT((curve.position(curve.length() - 1e-9) - curve.position(0)).norm(), 1e-6);
  EXPECT_LT((curve.position(2.5) - curve.position(2.5 + 3 * curve.length())).norm(), 1e-9);
  for (double s = 0; s < curve.length(); s += 0.05) {
    const Vector2 step = (curve.position(s + 1e-3) - curve.position(s)) / 1e-3;
    EXPECT_NEAR(step.norm(), 1, 0.02);
    EXPECT_LT((step.normalized() - Vector2(std::cos(curve.heading(s)), std::sin(curve.heading(s)))).norm(),
              0.01);
  }
}

TEST(CameraPath, EverySceneMovesSmoothly) {
  struct Case {
    Staging staging;
    double speed, turn;  ///< bounds [m/s], [rad/s]
  };
  const Case cases[] = {{make_courtyard(1), 1.8, 1.2},
                        {make_desk(1), 0.5, 0.5},
                        {make_corridor(1), 1.4, 2.0},
                        {make_descent(1), 1.6, 0.1}};
  for (const auto& c : cases) {
    constexpr double kStep = 1.0 / 30;
    Vector6 last = Vector6::Zero();
    for (double t = 0; t + kStep < c.staging.round_seconds - 0.2; t += kStep) {
      const Vector6 velocity = (c.staging.path(t).inverse() * c.staging.path(t + kStep)).log() / kStep;
      EXPECT_LT(velocity.head<3>().norm(), c.speed) << t;
      EXPECT_LT(velocity.tail<3>().norm(), c.turn) << t;
      if (t > 0) {
        EXPECT_LT((velocity - last).norm(), 0.5) << t;
      }
      last = velocity;
    }
  }
}

TEST(Courtyard, SecondRoundComesBackToTheFirstButNotExactly) {
  const Staging staging = make_courtyard(1);
  for (double t = 0; t < staging.round_seconds; t += 1.5) {
    const SE3 T_first_second = staging.path(t).inverse() * staging.path(t + staging.round_seconds);
    EXPECT_LT(T_first_second.translation().norm(), 0.6);
    EXPECT_GT(T_first_second.translation().norm(), 1e-3);
    EXPECT_LT(T_first_second.so3().log().norm(), 0.3);
  }
}

}  // namespace
}  // namespace twofold::synthetic
