#include "viewer/keyframe_images.hpp"

#include "viewer/image_message.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <stdexcept>
#include <vector>

namespace twofold {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

class KeyframeImagesTest : public ::testing::Test {
 protected:
  ViewedImage find(std::uint32_t keyframe) {
    asked_.push_back(keyframe);
    if (keyframe == 13) throw std::runtime_error("13.png: damaged");
    if (keyframe == 14) return {};
    return {{pixels_.data(), 8, 6, 8}, nullptr};
  }
  ViewMessageHeader header() const {
    ViewMessageHeader header;
    std::memcpy(&header, sight_.keyframe_image.bytes->data(), sizeof header);
    return header;
  }

  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(48, 99);
  std::vector<std::uint32_t> asked_;
  KeyframeImages images_{[this](std::uint32_t keyframe) { return find(keyframe); }};
  ViewSight sight_;
};

TEST_F(KeyframeImagesTest, EachGetsItsTurnFourTimesASecond) {
  const std::vector<std::uint32_t> wanted{5, 9};
  for (std::int64_t now_ns = kSecond; now_ns < 2 * kSecond; now_ns += 10'000'000)
    images_.answer(wanted, now_ns, sight_);
  EXPECT_EQ(asked_, (std::vector<std::uint32_t>{5, 9, 5, 9}));
  EXPECT_EQ(header().kind, ViewMessageKind::kKeyframeImage);
  EXPECT_EQ(header().number, 9U);
  EXPECT_EQ(header().a, 8U);
  EXPECT_NE(sight_.keyframe_image.bytes->find("JFIF"), std::string::npos);
}

TEST_F(KeyframeImagesTest, TheNewestAnswerServesAllWhoWantIt) {
  const std::vector<std::uint32_t> wanted{5, 5, 5};
  for (std::int64_t n = 1; n < 5; ++n) images_.answer(wanted, n * kSecond, sight_);
  EXPECT_EQ(asked_.size(), 1U);
}

TEST_F(KeyframeImagesTest, WhatCannotBeReadIsAnswered) {
  for (const std::uint32_t keyframe : {13U, 14U}) {
    images_.answer(std::vector{keyframe}, keyframe * kSecond, sight_);
    EXPECT_EQ(sight_.keyframe, keyframe);
    EXPECT_EQ(sight_.keyframe_image.bytes->size(), sizeof(ViewMessageHeader)) << "and nothing behind it";
  }
}

TEST(KeyframeImages, ThatThereWasNoneIsNotRemembered) {
  bool there = false;
  const std::vector<std::uint8_t> pixels(48, 99);
  KeyframeImages images([&](std::uint32_t) {
    return there ? ViewedImage{{pixels.data(), 8, 6, 8}, nullptr} : ViewedImage();
  });
  ViewSight sight;
  images.answer(std::vector<std::uint32_t>{3}, 0, sight);
  EXPECT_EQ(sight.keyframe, 3U);
  EXPECT_EQ(sight.keyframe_image.bytes->size(), sizeof(ViewMessageHeader));
  there = true;
  images.answer(std::vector<std::uint32_t>{}, 1'000'000'000, sight);
  EXPECT_EQ(sight.keyframe, kNoId) << "who clicks now does not get the old answer";
  images.answer(std::vector<std::uint32_t>{3}, 1'000'000'001, sight);
  EXPECT_EQ(sight.keyframe, 3U);
  EXPECT_GT(sight.keyframe_image.bytes->size(), sizeof(ViewMessageHeader));
}

TEST(ViewedImages, OddImagesAreNone) {
  const std::vector<std::uint16_t> pixels(4096, 9);
  const auto shown = [&](int width, int height, std::ptrdiff_t stride, ImageFormat format) {
    const ImageView image{pixels.data(), width, height, stride, format};
    return image_message(ViewMessageKind::kImage, 0, image).size() > sizeof(ViewMessageHeader);
  };
  EXPECT_TRUE(shown(8, 8, 8, ImageFormat::kGrey8));
  EXPECT_TRUE(shown(2000, 1, 2000, ImageFormat::kGrey8)) << "its height must not be rounded to none";
  EXPECT_FALSE(shown(0, 8, 8, ImageFormat::kGrey8));
  EXPECT_FALSE(shown(8, -1, 8, ImageFormat::kGrey8));
  EXPECT_FALSE(shown(8, 8, 8, ImageFormat::kRgb8)) << "rows that overlap";
  EXPECT_FALSE(shown(8, 8, 16, ImageFormat::kDepth16));
}

}  // namespace
}  // namespace twofold
