#include "imaging/level_pixels.hpp"

#include <gtest/gtest.h>

namespace twofold {
namespace {

/// Level pixel p covers level-0 pixels around its centre, (p + 0.5) 2^level - 0.5.
TEST(LevelPixels, CentresOfLevelPixels) {
  EXPECT_EQ(from_level(0, 1), 0.5);
  EXPECT_EQ(from_level(10, 3), 83.5);
  EXPECT_EQ(from_level(Eigen::Vector2f(0, 10), 3), Vector2(3.5, 83.5));
  EXPECT_EQ(to_level(83.5, 3), 10);
  EXPECT_EQ(to_level(Vector2(3.5, 83.5), 3), Eigen::Vector2f(0, 10));
}

TEST(LevelPixels, SinglePrecisionIsTheSameToItsRounding) {
  for (int level = 0; level < 4; ++level) {
    for (const float u : {0.3F, 17.77F, 639.2F}) {
      const Eigen::Vector2f p = to_level(u, 2 * u, level);
      EXPECT_NEAR(p.x(), to_level(double{u}, level), 1e-4);
      EXPECT_NEAR(p.y(), to_level(2 * double{u}, level), 1e-4);
      EXPECT_NEAR(from_level(p.x(), level), u, 1e-3);
    }
  }
}

}  // namespace
}  // namespace twofold
