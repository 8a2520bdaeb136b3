#include "loopclosure/similarity_estimator.hpp"

#include <gtest/gtest.h>

#include <array>
#include <utility>
#include <vector>

#include "geometry/ransac.hpp"
#include "tests/loopclosure/turning_camera.hpp"

namespace twofold {
namespace {

/// Points in two views, each corner turned as the camera is. One match in them is then spoiled.
class SimilarityEstimatorTest : public ::testing::Test {
 protected:
  static constexpr int kMatches = 20;
  static constexpr int kSpoiled = 3;
  Rig rig_ = testing::test_rig(SensorKind::kStereo);
  const SE3 T_b_a_{SO3::exp(Vector3(0.02, -0.05, 0.4)), Vector3(0.4, 0.1, -0.1)};
  PlaceAppearance a_, b_;
  std::vector<CornerMatch> matches_;
  const VerificationOptions options_;

  SimilarityEstimatorTest() {
    SplitMix64 random(4);
    const auto within = [&](double from, double to) {
      return from + (to - from) * 1e-6 * random.below(1'000'000);
    };
    for (int i = 0; i < kMatches; ++i) {
      const Vector3 x_a(within(-1, 1), within(-1, 1), within(2, 4));
      a_.pixels.push_back(rig_.project(x_a).cast<float>());
      b_.pixels.push_back(rig_.project(T_b_a_ * x_a).cast<float>());
      a_.corners.emplace_back().angle = 0.5F;
      b_.corners.emplace_back().angle = 0.5F + static_cast<float>(turn_of(T_b_a_.rotation()));
      matches_.push_back({0, i, i, x_a});
    }
  }
  [[nodiscard]] SimilarityEstimator estimator() const { return {rig_, a_, b_, matches_, options_}; }
  [[nodiscard]] bool is_inlier(int i) const {
    const double bound = options_.ransac_error_px * options_.ransac_error_px;
    return estimator().squared_residual(TwoWaySimilarity(Sim3(T_b_a_)), i) <= bound;
  }
  /// With how many others.
  [[nodiscard]] int agreements_of(std::size_t i) const {
    const AgreementGraph graph = estimator().agreements();
    int count = 0;
    for (std::size_t j = 0; j < kMatches; ++j) count += j != i && graph.agree(i, j) ? 1 : 0;
    return count;
  }
  [[nodiscard]] std::vector<TwoWaySimilarity> models_of(const std::array<int, 3>& sample) const {
    std::vector<TwoWaySimilarity> models;
    estimator().fit(sample, models);
    return models;
  }
  void expect_spoiled_alone() const {
    EXPECT_LE(agreements_of(kSpoiled), 3);
    EXPECT_TRUE(models_of({kSpoiled, 4, 5}).empty());
    for (std::size_t i = 0; i < kMatches; ++i) {
      EXPECT_EQ(is_inlier(static_cast<int>(i)), i != kSpoiled) << i;
      EXPECT_GE(agreements_of(i), i == kSpoiled ? 0 : kMatches - 2) << i;
    }
    ASSERT_EQ(models_of({0, 4, 5}).size(), 1U);
    EXPECT_LT((models_of({0, 4, 5})[0].S_b_a.without_scale().inverse() * T_b_a_).log().norm(), 0.01);
  }
};

TEST_F(SimilarityEstimatorTest, MatchesOfARigidSceneAgree) {
  for (int i = 0; i < kMatches; ++i) {
    EXPECT_EQ(agreements_of(static_cast<std::size_t>(i)), kMatches - 1) << i;
    EXPECT_TRUE(is_inlier(i)) << i;
  }
}

TEST_F(SimilarityEstimatorTest, APointThatIsElsewhereAgreesWithNone) {
  const Vector3 x_b = T_b_a_ * matches_[kSpoiled].x_a;
  b_.pixels[kSpoiled] = rig_.project(2 * x_b).cast<float>();
  expect_spoiled_alone();
}

TEST_F(SimilarityEstimatorTest, ACornerThatIsTurnedAgreesWithNone) {
  b_.corners[kSpoiled].angle += 2;
  expect_spoiled_alone();
}

/// Angles are so only but for full turns.
TEST_F(SimilarityEstimatorTest, AFullTurnIsNone) {
  for (int i = 0; i < kMatches; i += 2) b_.corners[static_cast<std::size_t>(i)].angle += 6.2831853F;
  for (int i = 0; i < kMatches; i += 3) a_.corners[static_cast<std::size_t>(i)].angle -= 6.2831853F;
  for (int i = 0; i < kMatches; ++i) EXPECT_EQ(agreements_of(static_cast<std::size_t>(i)), kMatches - 1) << i;
}

/// One camera counts positions in the image: of a point whose depth is wrong in b, b's tells nothing, and a's
/// does.
TEST_F(SimilarityEstimatorTest, ErrorsCountInEitherView) {
  rig_.kind = SensorKind::kMono;
  for (PlaceAppearance* side : {&a_, &b_}) {
    ASSERT_TRUE(is_inlier(kSpoiled));
    StereoPixelF& z = side->pixels[kSpoiled];
    const float right = std::exchange(z.z(), z.x() - 0.5F * (z.x() - z.z()));
    if (side == &a_) matches_[kSpoiled].x_a = rig_.unproject(z.cast<double>());
    EXPECT_FALSE(is_inlier(kSpoiled));
    z.z() = right;
    if (side == &a_) matches_[kSpoiled].x_a = rig_.unproject(z.cast<double>());
  }
}

}  // namespace
}  // namespace twofold
