#include "viewer/keyframe_images.hpp"

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

}  // namespace
}  // namespace twofold
