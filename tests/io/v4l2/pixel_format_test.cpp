#include "io/v4l2/pixel_format.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <vector>

#include "io/v4l2/jpeg.hpp"

namespace twofold {
namespace {

constexpr int kWidth = 37, kHeight = 11;  // odd, so that vector code has a rest
constexpr std::size_t kPadding = 13;

std::uint8_t truth(int x, int y) {
  return static_cast<std::uint8_t>(7 * x + 31 * y + 5);
}

/// The byte of a row that holds pixel x's luminance.
std::size_t luminance_byte(PixelFormat format, int x) {
  switch (format) {
    case PixelFormat::kYuyv:
      return static_cast<std::size_t>(2 * x);
    case PixelFormat::kUyvy:
    case PixelFormat::kY16:
      return static_cast<std::size_t>(2 * x + 1);
    default:
      return static_cast<std::size_t>(x);
  }
}

TEST(PixelFormatTest, EveryUncompressedFormatGivesItsLuminance) {
  for (const PixelFormat format : pixel_formats()) {
    if (format == PixelFormat::kMjpg || format == PixelFormat::kZ16) continue;
    ImageLayout layout{format, kWidth, kHeight, 0};
    layout.stride = layout.row_bytes() + kPadding;
    std::vector<std::uint8_t> image(layout.min_bytes(), 0xee);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        image[static_cast<std::size_t>(y) * layout.stride + luminance_byte(format, x)] = truth(x, y);
      }
    }
    constexpr std::size_t kOutStride = kWidth + 3;
    std::vector<std::uint8_t> grey(kOutStride * kHeight, 0xaa);
    ASSERT_TRUE(to_grey(layout, image, grey.data(), kOutStride)) << name(format);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        ASSERT_EQ(grey[static_cast<std::size_t>(y) * kOutStride + static_cast<std::size_t>(x)], truth(x, y))
            << name(format);
      }
      for (std::size_t x = kWidth; x < kOutStride; ++x) {
        ASSERT_EQ(grey[static_cast<std::size_t>(y) * kOutStride + x], 0xaa) << "wrote behind the row";
      }
    }
    if (const auto view = grey_in_place(layout, image)) {
      EXPECT_EQ(view->data[view->stride * 2 + 3], truth(3, 2));
    }
  }
}

TEST(PixelFormatTest, DepthIsCopiedAsItIs) {
  ImageLayout layout{PixelFormat::kZ16, kWidth, kHeight, 2 * kWidth + 6};
  std::vector<std::uint8_t> image(layout.min_bytes());
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = static_cast<std::uint8_t>(i * 37);
  std::vector<std::uint16_t> depth(kWidth * kHeight);
  to_depth(layout, image, depth.data(), 2 * kWidth);
  const std::size_t byte = 4 * layout.stride + 2 * 10;
  EXPECT_EQ(depth[4 * kWidth + 10], image[byte] + 256 * image[byte + 1]);
  EXPECT_FALSE(to_grey(layout, image, nullptr, 0));
}

TEST(PixelFormatTest, NamesAndCodesAreOneToOne) {
  for (const PixelFormat format : pixel_formats()) {
    EXPECT_EQ(pixel_format_from_fourcc(fourcc(format)), format);
    EXPECT_EQ(pixel_format_from_name(name(format)), format);
  }
  EXPECT_EQ(fourcc_text(fourcc(PixelFormat::kY16)), "Y16");
  EXPECT_EQ(fourcc_text(0x01020304), "????");
  EXPECT_FALSE(pixel_format_from_fourcc(0));
}

class JpegTest : public ::testing::Test {
 protected:
  JpegTest() : picture_(kRows, kCols, CV_8UC3) {
    for (int y = 0; y < kRows; ++y) {
      for (int x = 0; x < kCols; ++x) {
        picture_.at<cv::Vec3b>(y, x) =
            cv::Vec3b::all(static_cast<std::uint8_t>(128 + 60 * std::sin(0.2 * x) * std::cos(0.3 * y)));
      }
    }
    cv::imencode(".jpg", picture_, file_, {cv::IMWRITE_JPEG_QUALITY, 95});
  }
  [[nodiscard]] auto decode(std::span<const std::uint8_t> file, int cols = kCols, int rows = kRows) {
    grey_.create(rows, cols, CV_8UC1);
    return decode_jpeg_grey(file, cols, rows, grey_.data, grey_.step[0]);
  }

  static constexpr int kCols = 96, kRows = 64;
  cv::Mat picture_, grey_;
  std::vector<std::uint8_t> file_;
};

TEST_F(JpegTest, DecodesLuminance) {
  ASSERT_TRUE(decode(file_));
  double largest = 0;
  cv::Mat channel;
  cv::extractChannel(picture_, channel, 0);
  cv::minMaxLoc(cv::abs(grey_ - channel), nullptr, &largest);
  EXPECT_LT(largest, 8);
}

TEST_F(JpegTest, DecodesWithoutHuffmanTablesAndWithBytesBehindTheEnd) {
  ASSERT_TRUE(decode(file_));
  const cv::Mat expected = grey_.clone();
  std::vector<std::uint8_t> bare;  // as webcams send it: all DHT segments cut out
  for (std::size_t i = 2; i + 4 < file_.size() && file_[i] == 0xff;) {
    const std::size_t length = 2 + 256u * file_[i + 2] + file_[i + 3];
    if (bare.empty()) bare = {0xff, 0xd8};
    if (file_[i + 1] == 0xda) {
      bare.insert(bare.end(), file_.begin() + static_cast<std::ptrdiff_t>(i), file_.end());
      break;
    }
    if (file_[i + 1] != 0xc4) {
      bare.insert(bare.end(), file_.begin() + static_cast<std::ptrdiff_t>(i),
                  file_.begin() + static_cast<std::ptrdiff_t>(i + length));
    }
    i += length;
  }
  ASSERT_LT(bare.size(), file_.size() - 300);
  bare.resize(bare.size() + 1000, 0);
  const auto decoded = decode(bare);
  ASSERT_TRUE(decoded) << decoded.error();
  EXPECT_EQ(cv::norm(grey_, expected, cv::NORM_INF), 0);
}

TEST_F(JpegTest, RefusesWhatIsCutShortOrOfAnotherSize) {
  for (const double share : {0.01, 0.3, 0.6, 0.9, 0.98}) {
    const auto bytes = static_cast<std::size_t>(share * static_cast<double>(file_.size()));
    EXPECT_FALSE(decode(std::span(file_).first(bytes))) << share;
  }
  const auto other = decode(file_, 95, 64);
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error(), "the JPEG is 96x64");
}

TEST_F(JpegTest, SurvivesArbitraryDamage) {
  std::mt19937 random(5);
  int refused = 0;
  for (int round = 0; round < 2000; ++round) {
    std::vector<std::uint8_t> damaged = file_;
    for (int k = 0; k < 8; ++k) damaged[random() % damaged.size()] = static_cast<std::uint8_t>(random());
    if (!decode(damaged)) ++refused;
  }
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace twofold
