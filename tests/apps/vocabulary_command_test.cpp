#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <regex>

#include "tests/apps/command.hpp"

namespace twofold {
namespace {

/// Rectangles of random place, size and brightness: corners everywhere, others for every seed.
void write_rectangles(const std::string& file, std::uint64_t seed) {
  cv::RNG rng(seed);
  cv::Mat image(240, 320, CV_8U, cv::Scalar::all(128));
  for (int i = 0; i < 150; ++i) {
    // In braces: drawn in this order by every compiler.
    const cv::Point corner{rng.uniform(0, 300), rng.uniform(0, 220)};
    const cv::Size size{rng.uniform(8, 40), rng.uniform(8, 40)};
    cv::rectangle(image, {corner, size}, cv::Scalar::all(rng.uniform(0, 255)), cv::FILLED);
  }
  ASSERT_TRUE(cv::imwrite(file, image));
}

class VocabularyCommand : public testing::Test {
 protected:
  void SetUp() override {
    for (const int i : {1, 2, 3}) write_rectangles(image(i), static_cast<std::uint64_t>(i));
  }
  std::string image(int i) const { return folder_ / ("image" + std::to_string(i) + ".png"); }
  Outcome train(const std::string& out, int branching) const {
    return run(folder_, "train " + image(1) + " " + image(2) + " " + image(3) + " --branching " +
                            std::to_string(branching) + " --levels 3 --out " + (folder_ / out));
  }
  double score(int a, int b) const {
    const Outcome outcome =
        run(folder_, "--vocabulary " + (folder_ / "words") + " score " + image(a) + " " + image(b));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return std::atof(outcome.out.c_str());
  }

  const ScratchFolder folder_;
};

TEST_F(VocabularyCommand, TrainsTheSameWordsFromTheSameImages) {
  const Outcome outcome = train("words", 4);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("3 images"), std::string::npos) << outcome.out;
  ASSERT_EQ(train("again", 4).exit_code, 0);
  EXPECT_EQ(content(folder_ / "words"), content(folder_ / "again"));
  const Outcome info = run(folder_, "--vocabulary " + (folder_ / "words") + " info");
  ASSERT_EQ(info.exit_code, 0) << info.err;
  // Four by four by four, but for clusters that lose all their descriptors to others while they are refined.
  std::smatch words;
  ASSERT_TRUE(std::regex_search(info.out, words, std::regex("words +([0-9]+)\n"))) << info.out;
  EXPECT_LE(std::stoi(words[1]), 64);
  EXPECT_GE(std::stoi(words[1]), 60);
  EXPECT_NE(info.out.find("depth   3\n"), std::string::npos) << info.out;
}

TEST_F(VocabularyCommand, AnImageIsMostLikeItself) {
  ASSERT_EQ(train("words", 10).exit_code, 0);  // enough words that most are not in every image
  EXPECT_NEAR(score(1, 1), 1, 1e-6);
  EXPECT_LT(score(1, 2), 0.5);
  EXPECT_GT(score(1, 2), 0.01);
  EXPECT_NEAR(score(1, 2), score(2, 1), 1e-6);
}

TEST_F(VocabularyCommand, EvaluatesASourceWithTruePoses) {
  const Outcome outcome = run(
      folder_, "evaluate 'synthetic:desk?width=320&height=240&sensor=rgbd&fps=2&frames=12' --gap 2 --csv " +
                   (folder_ / "stages.csv") + " --plot " + (folder_ / "curve.png"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("12 images"), std::string::npos) << outcome.out;
  EXPECT_NE(content(folder_ / "stages.csv").find("query,place,"), std::string::npos);
  EXPECT_FALSE(cv::imread(folder_ / "curve.png").empty());
}

TEST_F(VocabularyCommand, BadInputIsOneLineAndExitCodeTwo) {
  expect_bad_input(run(folder_, ""), "subcommand");
  expect_bad_input(run(folder_, "train " + (folder_ / "none") + " --out " + (folder_ / "words")), "none");
  expect_bad_input(run(folder_, "train " + image(1)), "--out");
  folder_.write("broken", "no vocabulary");
  expect_bad_input(run(folder_, "--vocabulary " + (folder_ / "broken") + " info"), "broken");
  expect_bad_input(run(folder_, "evaluate " + (folder_ / "none")), "none");
}

}  // namespace
}  // namespace twofold
