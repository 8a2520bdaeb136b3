#include "surface/free_space/nearest_points.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

namespace twofold {
namespace {

float nearest_of_all(const std::vector<Eigen::Vector3f>& points, const Eigen::Vector3f& x) {
  float least = std::numeric_limits<float>::infinity();
  for (const Eigen::Vector3f& point : points) least = std::min(least, (point - x).norm());
  return least;
}

/// Few points, far from most cells, and many, near to all; in grids longer than wide and flat ones.
TEST(NearestPoints, AreFoundWhicheverWayTheyLie) {
  std::mt19937 random(7);
  for (const Eigen::Vector3i& size : {Eigen::Vector3i(23, 7, 12), Eigen::Vector3i(40, 31, 1)}) {
    for (const int count : {1, 5, 60, 2000}) {
      std::vector<Eigen::Vector3f> points;
      for (int n = 0; n < count; ++n) {
        Eigen::Vector3f point;
        for (int axis = 0; axis < 3; ++axis)
          point[axis] = std::uniform_real_distribution<float>(0, static_cast<float>(size[axis]))(random);
        points.push_back(point);
      }
      const NearestPoints nearest(size, points);
      int exact = 0, cells = 0;
      for (int z = 0; z < size.z(); ++z) {
        for (int y = 0; y < size.y(); ++y) {
          for (int x = 0; x < size.x(); ++x) {
            const float truth = nearest_of_all(
                points,
                Eigen::Vector3f(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)).array() +
                    0.5F);
            const float found = nearest.distance({x, y, z});
            ASSERT_GE(found, truth - 1e-4F);
            ASSERT_LE(found, truth + 0.87F) << count << " points, cell " << x << " " << y << " " << z;
            exact += found < truth + 1e-4F ? 1 : 0;
            ++cells;
          }
        }
      }
      EXPECT_GT(exact, 0.95 * cells) << count;
    }
  }
}

TEST(NearestPoints, OfNoneAreInfinitelyFar) {
  const std::vector<Eigen::Vector3f> outside{{-0.1F, 1, 1}, {1, 1, 3}, {1e20F, 0, 0}, {NAN, 1, 1}};
  const NearestPoints nearest({3, 3, 3}, outside);
  EXPECT_EQ(nearest.distance({1, 1, 1}), std::numeric_limits<float>::infinity());
}

}  // namespace
}  // namespace twofold
