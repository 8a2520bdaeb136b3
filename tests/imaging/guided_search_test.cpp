#include "imaging/guided_search.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "fixtures/rendered_scene.hpp"
#include "geometry/inverse_depth.hpp"
#include "imaging/fast_corners.hpp"

namespace twofold {
namespace {

using testing::RenderedScene;
using testing::test_rig;

constexpr double kNoise = 2;  // sensor noise [grey]

struct Start {
  PointAppearance appearance;
  Vector3 psi;
  Corner corner;
};

/// Corners of one view with their true depth.
std::vector<Start> corners_of(const RenderedScene& scene, const Rig& rig, const FrameImages& images,
                              const SE3& T_c_w) {
  std::vector<Corner> corners;
  corners.reserve(4000);
  CellGrid grid{32, rig.camera.width / 32, rig.camera.height / 32, {}};
  const std::vector<std::uint8_t> none(static_cast<std::size_t>(grid.columns * grid.rows), 0);
  grid.occupied = none;
  for (int level = 0; level < 3; ++level) {
    detect_corners(images.left.level(level), level, 10, 15, 12, grid, corners);
  }
  std::vector<Start> starts;
  for (const Corner& corner : corners) {
    Start start;
    start.corner = corner;
    if (!cut_appearance(images.left.level(corner.level), corner.u, corner.v, corner.level,
                        start.appearance)) {
      continue;
    }
    const Vector2 uv = start.appearance.uv.cast<double>();
    const Vector3 ray = rig.camera.unproject(uv);
    start.psi = {ray.x(), ray.y(), 1 / scene.depth(T_c_w, uv)};
    starts.push_back(start);
  }
  return starts;
}

/// Errors in pixels of the level a point was found on.
struct Errors {
  double u2 = 0, v2 = 0, disparity2 = 0, disparity = 0;
  int tried = 0, found = 0, with_right = 0;

  [[nodiscard]] double rms_u() const { return std::sqrt(u2 / found); }
  [[nodiscard]] double rms_v() const { return std::sqrt(v2 / found); }
  [[nodiscard]] double rms_disparity() const { return std::sqrt(disparity2 / with_right); }
};

struct Motion {
  const char* name;
  Vector6 xi;
  double found_share;
};

class GuidedSearch : public ::testing::TestWithParam<Motion> {
 protected:
  Errors search(const SE3& T_c_a, const SE3& T_c_a_predicted) {
    const SE3 T_a_w;
    FrameImages first, second;
    scene_.render(T_a_w, kNoise, first);
    scene_.render(T_c_a * T_a_w, kNoise, second);
    Errors errors;
    for (const Start& start : corners_of(scene_, rig_, first, T_a_w)) {
      const Vector3 x_c = T_c_a * from_inverse_depth(start.psi);
      if (x_c.z() < 0.5) continue;
      const Vector3 truth = rig_.project(x_c);
      const int border = 16 << start.corner.level;
      if (!rig_.camera.contains(truth.head<2>(), border) || truth.z() < border) continue;
      ++errors.tried;
      const auto match = find_point(second, rig_, start.appearance, start.psi, T_c_a_predicted, {});
      if (!match) continue;
      add(errors, match->pixel, truth, match->level);
    }
    return errors;
  }
  static void add(Errors& errors, const Vector3& z, const Vector3& truth, int level) {
    const double s = std::ldexp(1.0, -level);
    const Vector3 e = (z - truth) * s;
    ++errors.found;
    errors.u2 += e.x() * e.x();
    errors.v2 += e.y() * e.y();
    if (std::isnan(e.z())) return;
    ++errors.with_right;
    errors.disparity += e.x() - e.z();
    errors.disparity2 += (e.x() - e.z()) * (e.x() - e.z());
  }

  Rig rig_ = test_rig(SensorKind::kStereo);
  RenderedScene scene_{rig_, {4, 2.5, 5}, 7};
};

TEST_P(GuidedSearch, FindsPointsToAFewHundredthsOfAPixel) {
  const Motion& motion = GetParam();
  const SE3 T_c_a = SE3::exp(motion.xi);
  const Errors errors = search(T_c_a, T_c_a);
  std::printf("%s: %d of %d found, rms u %.3f v %.3f disparity %.3f (mean %+.3f) px\n", motion.name,
              errors.found, errors.tried, errors.rms_u(), errors.rms_v(), errors.rms_disparity(),
              errors.disparity / errors.with_right);
  ASSERT_GT(errors.tried, 200);
  EXPECT_GT(errors.found, motion.found_share * errors.tried);
  EXPECT_GT(errors.with_right, 0.95 * errors.found);
  EXPECT_LT(errors.rms_u(), 0.06);
  EXPECT_LT(errors.rms_v(), 0.06);
  EXPECT_LT(errors.rms_disparity(), 0.06);
  EXPECT_LT(std::abs(errors.disparity / errors.with_right), 0.03);
}

TEST_P(GuidedSearch, ForgivesAPredictionTwoPixelsOff) {
  const Motion& motion = GetParam();
  const SE3 T_c_a = SE3::exp(motion.xi);
  const SE3 off(SO3::exp(Vector3(2 / rig_.camera.fx, -1.5 / rig_.camera.fx, 0)), Vector3::Zero());
  const Errors errors = search(T_c_a, off * T_c_a);
  // A pixel of texture may look alike two pixels away: the few that do are for the robust kernel.
  EXPECT_GT(errors.found, (motion.found_share - 0.05) * errors.tried);
  EXPECT_LT(errors.rms_u(), 0.25);
  EXPECT_LT(errors.rms_v(), 0.25);
}

INSTANTIATE_TEST_SUITE_P(
    Motions, GuidedSearch,
    ::testing::Values(Motion{"rest", Vector6::Zero(), 0.98},
                      Motion{"sideways", (Vector6() << 0.1, 0.02, 0, 0, 0, 0).finished(), 0.9},
                      Motion{"forward", (Vector6() << 0.01, 0.02, -0.5, 0, 0, 0).finished(), 0.85},
                      Motion{"far forward", (Vector6() << 0.01, 0.02, -1.2, 0, 0, 0).finished(), 0.85},
                      Motion{"roll", (Vector6() << 0.1, 0.02, 0, 0, 0, 0.35).finished(), 0.85},
                      Motion{"yaw", (Vector6() << 0.1, 0.02, 0, 0, 0.26, 0).finished(), 0.9}),
    [](const auto& motion) {
      std::string name = motion.param.name;
      std::replace(name.begin(), name.end(), ' ', '_');
      return name;
    });

TEST_F(GuidedSearch, SurvivesAChangeOfExposure) {
  FrameImages first, second;
  scene_.render(SE3(), kNoise, first);
  const SE3 T_c_a = SE3::exp((Vector6() << 0.05, 0, 0, 0, 0.02, 0).finished());
  const auto darken = [](const cv::Mat& image) {
    cv::Mat dark;
    image.convertTo(dark, CV_8UC1, 0.7, 12);
    return dark;
  };
  scene_.render(T_c_a, kNoise, second);
  second.left.build(darken(second.left.level(0)));
  second.right.build(darken(second.right.level(0)));
  Errors errors;
  for (const Start& start : corners_of(scene_, rig_, first, SE3())) {
    const Vector3 truth = rig_.project(T_c_a * from_inverse_depth(start.psi));
    if (!rig_.camera.contains(truth.head<2>(), 60) || truth.z() < 60) continue;
    ++errors.tried;
    if (const auto match = find_point(second, rig_, start.appearance, start.psi, T_c_a, {})) {
      add(errors, match->pixel, truth, match->level);
    }
  }
  EXPECT_GT(errors.found, 0.9 * errors.tried);
  EXPECT_LT(errors.rms_u(), 0.06);
  EXPECT_LT(errors.rms_v(), 0.06);
}

/// Seen in the dark, looked for in the light: flat places are more like a faint patch than its own place is.
TEST_F(GuidedSearch, FindsInTheLightWhatWasSeenInTheDark) {
  constexpr double kDark = 0.3;
  FrameImages dark, bright;
  scene_.render(SE3(), kNoise, dark);
  const auto darken = [](const cv::Mat& image) {
    cv::Mat dim;
    image.convertTo(dim, CV_8UC1, kDark);
    return dim;
  };
  const std::vector<Start> starts = corners_of(scene_, rig_, dark, SE3());
  const cv::Mat left = darken(dark.left.level(0));
  dark.left.build(left);
  const SE3 T_c_a = SE3::exp((Vector6() << 0.05, 0, 0, 0, 0.02, 0).finished());
  scene_.render(T_c_a, kNoise, bright);
  std::vector<double> ratios;
  Errors as_it_is, brighter;
  for (Start start : starts) {
    ASSERT_TRUE(cut_appearance(dark.left.level(start.corner.level), start.corner.u, start.corner.v,
                               start.corner.level, start.appearance));
    const Vector3 truth = rig_.project(T_c_a * from_inverse_depth(start.psi));
    if (!rig_.camera.contains(truth.head<2>(), 60) || truth.z() < 60) continue;
    if (const auto ratio =
            brightness_since_anchor(bright.left, rig_.camera, start.appearance, start.psi, T_c_a))
      ratios.push_back(*ratio);
    for (const double gain : {1.0, 1 / kDark}) {
      Errors& errors = gain == 1 ? as_it_is : brighter;
      ++errors.tried;
      const GuidedSearchOptions options{.gain = static_cast<float>(gain)};
      if (const auto match = find_point(bright, rig_, start.appearance, start.psi, T_c_a, options))
        add(errors, match->pixel, truth, match->level);
    }
  }
  ASSERT_GT(ratios.size(), 200U);
  std::sort(ratios.begin(), ratios.end());
  EXPECT_NEAR(ratios[ratios.size() / 2], 1 / kDark, 0.15 / kDark);
  std::printf("%d, as bright as the view %d, of %d found\n", as_it_is.found, brighter.found, brighter.tried);
  EXPECT_LT(as_it_is.found, 0.5 * as_it_is.tried);
  EXPECT_GT(brighter.found, 0.85 * brighter.tried);
  EXPECT_LT(brighter.rms_u(), 0.15);
  EXPECT_LT(brighter.rms_v(), 0.15);
}

TEST_F(GuidedSearch, FindsNothingWhereThereIsNothing) {
  FrameImages first, second;
  scene_.render(SE3(), kNoise, first);
  RenderedScene other(rig_, {4, 2.5, 5}, 99);
  other.render(SE3(), kNoise, second);
  int tried = 0;
  int found = 0;
  for (const Start& start : corners_of(scene_, rig_, first, SE3())) {
    ++tried;
    found += find_point(second, rig_, start.appearance, start.psi, SE3(), {}).has_value();
  }
  EXPECT_LT(found, 0.05 * tried);
}

TEST_F(GuidedSearch, RefusesPointsBehindOutsideAndAtTheWrongScale) {
  FrameImages images;
  scene_.render(SE3(), 0, images);
  const Start start = corners_of(scene_, rig_, images, SE3()).front();
  const double depth = 1 / start.psi.z();
  const auto moved = [&](const Vector3& t) {
    return find_point(images, rig_, start.appearance, start.psi, SE3(SO3(), t), {});
  };
  EXPECT_TRUE(moved(Vector3::Zero()));
  EXPECT_FALSE(moved({0, 0, -depth - 1}));  // behind
  EXPECT_FALSE(moved({100, 0, 0}));         // beside
  EXPECT_FALSE(moved({0, 0, 30 * depth}));  // too small to be recognised
}

TEST_F(GuidedSearch, StartsDepthFromTheRow) {
  FrameImages images;
  scene_.render(SE3(), kNoise, images);
  for (int level = 0; level < 3; ++level) {
    Errors errors;
    for (const Start& start : corners_of(scene_, rig_, images, SE3())) {
      if (start.corner.level != level) continue;
      const Vector3 truth = rig_.project(from_inverse_depth(start.psi));
      if (truth.z() < (16 << level)) continue;
      ++errors.tried;
      const double u_r = right_from_row(images, rig_, start.corner.u, start.corner.v, level, {});
      if (!std::isnan(u_r)) add(errors, {truth.x(), truth.y(), u_r}, truth, level);
    }
    std::printf("level %d: %d of %d found, rms disparity %.3f (mean %+.3f) px\n", level, errors.found,
                errors.tried, errors.rms_disparity(), errors.disparity / errors.found);
    EXPECT_GT(errors.found, 0.9 * errors.tried);
    EXPECT_LT(errors.rms_disparity(), 0.06);
  }
}

TEST_F(GuidedSearch, RepeatedTextureGivesNoDepth) {
  cv::Mat image(rig_.camera.height, rig_.camera.width, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      image.at<std::uint8_t>(v, u) = (u / 10 + v / 10) % 2 == 0 ? 60 : 190;
    }
  }
  FrameImages images;
  images.left.build(image);
  images.right.build(image);
  EXPECT_TRUE(std::isnan(right_from_row(images, rig_, 400, 240, 0, {})));
}

}  // namespace
}  // namespace twofold
