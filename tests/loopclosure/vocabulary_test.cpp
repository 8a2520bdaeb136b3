#include "loopclosure/vocabulary.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "apps/vocabulary/vocabulary_trainer.hpp"
#include "fixtures/option_rules.hpp"
#include "loopclosure/place_index.hpp"

namespace twofold {
namespace {

BinaryDescriptor random_descriptor(std::mt19937_64& rng) {
  return {{rng(), rng(), rng(), rng()}};
}

BinaryDescriptor with_noise(BinaryDescriptor d, int flips, std::mt19937_64& rng) {
  for (int i = 0; i < flips; ++i) {
    const std::uint64_t bit = rng() % 256;
    d.bits[bit / 64] ^= std::uint64_t{1} << (bit % 64);
  }
  return d;
}

/// Images of `places` places, each seen `views` times with noisy descriptors.
std::vector<std::vector<BinaryDescriptor>> noisy_views(int places, int views, int corners,
                                                       std::mt19937_64& rng) {
  std::vector<std::vector<BinaryDescriptor>> images;
  for (int p = 0; p < places; ++p) {
    std::vector<BinaryDescriptor> place;
    for (int c = 0; c < corners; ++c) place.push_back(random_descriptor(rng));
    for (int v = 0; v < views; ++v) {
      images.emplace_back();
      for (const BinaryDescriptor& d : place) images.back().push_back(with_noise(d, 12, rng));
    }
  }
  return images;
}

std::vector<DescribedCorner> corners_of(const std::vector<BinaryDescriptor>& descriptors) {
  std::vector<DescribedCorner> corners(descriptors.size());
  for (std::size_t i = 0; i < corners.size(); ++i) corners[i].descriptor = descriptors[i];
  return corners;
}

class VocabularyTest : public ::testing::Test {
 protected:
  std::mt19937_64 rng_{7};
  std::vector<std::vector<BinaryDescriptor>> images_ = noisy_views(20, 3, 60, rng_);
  Vocabulary vocabulary_ = train_vocabulary(images_, {.branching = 6, .levels = 3});
  std::filesystem::path file_ = std::filesystem::path(::testing::TempDir()) / "vocabulary_test.tfvoc";

  std::vector<std::uint8_t> saved_bytes() {
    vocabulary_.save(file_);
    std::ifstream in(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }
};

TEST_F(VocabularyTest, ViewsOfOnePlaceScoreAboveAllOthers) {
  for (std::size_t i = 0; i < images_.size(); i += 3) {
    const BagOfWords query = vocabulary_.bag(corners_of(images_[i]));
    EXPECT_NEAR(bag_score(query, query), 1.0, 1e-5);
    const double same = bag_score(query, vocabulary_.bag(corners_of(images_[i + 1])));
    for (std::size_t j = 0; j < images_.size(); ++j) {
      if (j / 3 == i / 3) continue;
      EXPECT_GT(same, bag_score(query, vocabulary_.bag(corners_of(images_[j])))) << i << " against " << j;
    }
  }
}

TEST(VocabularyTrainer, SaysWhyItsOptionsAreInvalid) {
  testing::expect_rules<VocabularyTrainerOptions>(
      {{"branching", [](auto& o) { o.branching = 1; }}, {"levels", [](auto& o) { o.levels = 7; }}});
}

TEST_F(VocabularyTest, TrainingIsReproducible) {
  const Vocabulary again = train_vocabulary(images_, {.branching = 6, .levels = 3});
  ASSERT_EQ(again.nodes().size(), vocabulary_.nodes().size());
  for (std::size_t n = 0; n < again.nodes().size(); ++n) {
    EXPECT_EQ(again.nodes()[n].descriptor, vocabulary_.nodes()[n].descriptor);
    EXPECT_EQ(again.nodes()[n].idf, vocabulary_.nodes()[n].idf);
  }
}

TEST_F(VocabularyTest, SurvivesSavingAndLoading) {
  vocabulary_.save(file_);
  const Vocabulary loaded = Vocabulary::load(file_);
  EXPECT_EQ(loaded.word_count(), vocabulary_.word_count());
  EXPECT_EQ(loaded.depth(), vocabulary_.depth());
  for (const auto& image : images_) {
    EXPECT_EQ(loaded.bag(corners_of(image)), vocabulary_.bag(corners_of(image)));
  }
}

TEST_F(VocabularyTest, DamagedFilesAreRefused) {
  const std::vector<std::uint8_t> good = saved_bytes();
  ASSERT_NO_THROW((void)Vocabulary::parse(good, "good"));
  std::mt19937 rng(3);
  for (int i = 0; i < 300; ++i) {
    std::vector<std::uint8_t> bad = good;
    bad[rng() % bad.size()] ^= static_cast<std::uint8_t>(1U << (rng() % 8));
    EXPECT_THROW((void)Vocabulary::parse(bad, "flipped"), std::runtime_error);
    bad = good;
    bad.resize(rng() % good.size());
    EXPECT_THROW((void)Vocabulary::parse(bad, "truncated"), std::runtime_error);
  }
}

TEST_F(VocabularyTest, IndexFindsTheOtherViewsOfAPlaceAndHonoursExclusion) {
  PlaceIndex places(vocabulary_.word_count());
  std::vector<BagOfWords> bags;
  for (const auto& image : images_) bags.push_back(vocabulary_.bag(corners_of(image)));
  for (std::uint32_t k = 0; k < bags.size(); ++k) places.add(KeyframeId{k}, bags[k]);
  for (std::uint32_t k = 0; k < bags.size(); ++k) {
    const auto found = places.query(bags[k], 2, [&](KeyframeId id) { return id != KeyframeId{k}; });
    ASSERT_EQ(found.size(), 2U);
    for (const PlaceCandidate& candidate : found) {
      EXPECT_EQ(index(candidate.keyframe) / 3, k / 3);
      EXPECT_NE(index(candidate.keyframe), k);
      EXPECT_NEAR(candidate.score, bag_score(bags[k], bags[index(candidate.keyframe)]), 1e-4);
    }
  }
}

}  // namespace
}  // namespace twofold
