#include "camera/opencv_distortion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace twofold {
namespace {

const std::vector<double> kEight{0.44, -2.5, 0.0006, -0.0002, 1.46, 0.31, -2.34, 1.39};

std::vector<double> kept(std::size_t count, std::vector<double> coefficients = kEight) {
  coefficients.resize(count);
  return coefficients;
}

TEST(OpenCvDistortion, IsRationalWhereThereIsADenominator) {
  for (const std::size_t count : {8U, 12U, 14U}) {
    const auto distortion = opencv_distortion(kept(count));
    ASSERT_TRUE(distortion) << distortion.error();
    EXPECT_EQ(distortion->model, DistortionModel::kRational);
    EXPECT_TRUE(std::equal(kEight.begin(), kEight.end(), distortion->coefficients.begin()));
  }
  EXPECT_EQ(opencv_distortion(std::vector<double>{0, 0, 0, 0, 0, 0, 0, 0.1})->model,
            DistortionModel::kRational);
}

TEST(OpenCvDistortion, IsRadialTangentialWithoutOne) {
  EXPECT_EQ(opencv_distortion(kept(4))->model, DistortionModel::kRadTan);
  for (const std::size_t count : {5U, 8U, 12U, 14U}) {
    const auto distortion = opencv_distortion(kept(count, kept(5)));
    ASSERT_TRUE(distortion) << distortion.error();
    EXPECT_EQ(distortion->model, DistortionModel::kRadTan);
    EXPECT_EQ(distortion->coefficients[4], 1.46);
  }
}

TEST(OpenCvDistortion, SaysWhyThereIsNone) {
  for (const std::size_t count : {0U, 3U, 6U, 7U, 9U, 13U, 15U})
    EXPECT_EQ(opencv_distortion(kept(count)).error(),
              "has " + std::to_string(count) + " coefficients, not 4, 5, 8, 12 or 14");
  for (const std::size_t extra : {8U, 11U, 12U, 13U}) {
    auto coefficients = kept(14);
    coefficients[extra] = 1e-4;
    EXPECT_NE(opencv_distortion(coefficients).error().find("thin prism or a tilted sensor"),
              std::string::npos);
    coefficients[extra] = NAN;
    EXPECT_FALSE(opencv_distortion(coefficients));
  }
}

TEST(EquidistantDistortion, HasFourCoefficientsAndZerosBehindThem) {
  for (const std::vector<double>& k : {kept(4), kept(14, kept(4))}) {
    const auto distortion = equidistant_distortion(k);
    ASSERT_TRUE(distortion) << distortion.error();
    EXPECT_EQ(distortion->model, DistortionModel::kEquidistant);
    EXPECT_TRUE(std::equal(k.begin(), k.begin() + 4, distortion->coefficients.begin()));
    EXPECT_TRUE(std::all_of(distortion->coefficients.begin() + 4, distortion->coefficients.end(),
                            [](double c) { return c == 0; }));
  }
  for (const std::vector<double>& k : {kept(0), kept(3), kept(5)})
    EXPECT_EQ(equidistant_distortion(k).error(),
              "has " + std::to_string(k.size()) + " coefficients, equidistant has 4");
}

}  // namespace
}  // namespace twofold
