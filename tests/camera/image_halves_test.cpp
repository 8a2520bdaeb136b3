#include "camera/image_halves.hpp"

#include <gtest/gtest.h>

namespace twofold {
namespace {

TEST(ImageHalves, TheEmptiestHalfCounts) {
  ImageHalves halves(PinholeCamera{500, 500, 320, 240, 640, 480});
  EXPECT_EQ(halves.least(), 0);
  halves.add({100, 100});  // left, upper
  halves.add({500, 100});  // right, upper
  EXPECT_EQ(halves.least(), 0);
  halves.add({500, 300});  // right, lower
  EXPECT_EQ(halves.least(), 1);
  halves.add({320, 240});  // right, lower: the centre is no part of the left and upper halves
  EXPECT_EQ(halves.least(), 1);
  halves.add({319, 300});  // left, lower
  EXPECT_EQ(halves.least(), 2);
}

}  // namespace
}  // namespace twofold
