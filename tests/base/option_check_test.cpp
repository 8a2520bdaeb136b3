#include "base/option_check.hpp"

#include <limits>

#include "fixtures/option_rules.hpp"
#include "geometry/consistent_matches.hpp"
#include "geometry/ransac.hpp"

namespace twofold {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(OptionCheck, NamesFieldRuleAndValueOfTheFirstBrokenRule) {
  EXPECT_EQ(OptionCheck().at_least("a", 1, 1).above("b", 0.1, 0).within("c", 2, 1, 2).reason(), "");
  EXPECT_EQ(OptionCheck().at_least("a", 0, 1).at_least("b", 0, 1).reason(), "a must be >= 1, is 0");
  EXPECT_EQ(OptionCheck().above("a", 0.5, 0.5).reason(), "a must be > 0.5, is 0.5");
  EXPECT_EQ(OptionCheck().within("a", 300, 1, 255).reason(), "a must be in [1, 255], is 300");
  EXPECT_EQ(OptionCheck().share("a", 0).reason(), "a must be in (0, 1], is 0");
  EXPECT_EQ(OptionCheck().that(false, "a", "even", 3).reason(), "a must be even, is 3");
}

TEST(OptionCheck, NamesWhereNestedOptionsAre) {
  const std::string reason = OptionCheck().above("radius_px", -1, 0).reason();
  EXPECT_EQ(OptionCheck().nested("search", reason).at_least("a", 0, 1).reason(),
            "search.radius_px must be > 0, is -1");
  EXPECT_EQ(OptionCheck().at_least("a", 0, 1).nested("search", reason).reason(), "a must be >= 1, is 0");
  EXPECT_EQ(OptionCheck().nested("search", "").reason(), "");
}

TEST(OptionCheck, SaysASentenceWhereANumberSaysNothing) {
  EXPECT_EQ(OptionCheck().rule(true, "a needs b").at_least("c", 0, 1).reason(), "c must be >= 1, is 0");
  EXPECT_EQ(OptionCheck().rule(false, "a needs b").at_least("c", 0, 1).reason(), "a needs b");
  EXPECT_EQ(OptionCheck().at_least("c", 0, 1).rule(false, "a needs b").reason(), "c must be >= 1, is 0");
}

TEST(OptionCheck, NanKeepsNoRule) {
  EXPECT_NE(OptionCheck().at_least("a", kNan, 0).reason(), "");
  EXPECT_NE(OptionCheck().above("a", kNan, 0).reason(), "");
  EXPECT_NE(OptionCheck().within("a", kNan, 0, 1).reason(), "");
  EXPECT_NE(OptionCheck().share("a", kNan).reason(), "");
}

TEST(GeometryOptions, SayWhyTheyAreInvalid) {
  testing::expect_rules<ConsistencyOptions>(
      {{"threshold", [](auto& o) { o.threshold = -1; }}, {"sigmas", [](auto& o) { o.sigmas = kNan; }}});
  testing::expect_rules<RansacOptions>({{"threshold", [](auto& o) { o.threshold = 0; }},
                                        {"confidence", [](auto& o) { o.confidence = 1; }},
                                        {"max_iterations", [](auto& o) { o.max_iterations = 0; }}},
                                       {.threshold = 1});
}

}  // namespace
}  // namespace twofold
