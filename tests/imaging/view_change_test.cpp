#include "imaging/view_change.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace twofold {
namespace {

const PinholeCamera kCamera{400, 400, 320, 240, 640, 480};
const Vector3 kPoint(0, 0, 4), kAnchor(0, 0, 0);  // straight ahead of where the anchor stood

/// A camera at c that looks at the point.
SE3 look_from(const Vector3& c) {
  const Vector3 z = (kPoint - c).normalized(), x = Vector3::UnitY().cross(z).normalized();
  Matrix3 R_c_w;
  R_c_w << x.transpose(), z.cross(x).transpose(), z.transpose();
  return {SO3(Eigen::Quaterniond(R_c_w)), -(R_c_w * c)};
}

/// As far from the point as the anchor, from another side.
SE3 look_from_aside(double degrees) {
  const double angle = degrees / 180 * std::numbers::pi;
  return look_from(kPoint - 4 * Vector3(std::sin(angle), 0, std::cos(angle)));
}

bool sees(const SE3& T_c_w, const ViewLimits& limits) {
  return SimilarView(kCamera, T_c_w, limits).find(kPoint, kAnchor).has_value();
}

TEST(SimilarView, FindsThePixelOfWhatItSees) {
  const auto uv = SimilarView(kCamera, SE3(SO3(), {1, 0.5, 0}), {}).find(kPoint, kAnchor);
  ASSERT_TRUE(uv);
  EXPECT_LT((*uv - Vector2(420, 290)).norm(), 1e-9);
  EXPECT_FALSE(sees(SE3(SO3(), {0, 0, -5}), {}));  // behind
  EXPECT_FALSE(sees(SE3(SO3(), {4, 0, 0}), {}));   // beside the image
}

TEST(SimilarView, LeavesOutWhatIsNearTheImagesEdge) {
  const SE3 T_c_w(SO3(), {3, 0, 0});  // at u = 620 of 0 .. 639
  EXPECT_TRUE(sees(T_c_w, {.border_px = 18}));
  EXPECT_FALSE(sees(T_c_w, {.border_px = 20}));
}

TEST(SimilarView, LeavesOutWhatItSeesFromAnotherSide) {
  const ViewLimits limits{.min_cosine = std::cos(30.0 / 180 * std::numbers::pi)};
  for (const double side : {-1.0, 1.0}) {
    EXPECT_TRUE(sees(look_from_aside(side * 29), limits));
    EXPECT_FALSE(sees(look_from_aside(side * 31), limits));
    EXPECT_TRUE(sees(look_from_aside(side * 31), {}));
  }
}

TEST(SimilarView, LeavesOutWhatItSeesFromAnotherDistance) {
  const ViewLimits limits{.max_scale_change = 1.5};
  EXPECT_TRUE(sees(look_from({0, 0, 4 - 4 * 1.49}), limits));
  EXPECT_FALSE(sees(look_from({0, 0, 4 - 4 * 1.51}), limits));
  EXPECT_TRUE(sees(look_from({0, 0, 4 - 4 / 1.49}), limits));
  EXPECT_FALSE(sees(look_from({0, 0, 4 - 4 / 1.51}), limits));
  EXPECT_TRUE(sees(look_from({0, 0, 4 - 4 * 1.51}), {}));
}

}  // namespace
}  // namespace twofold
