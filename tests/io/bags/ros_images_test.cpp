#include "io/bags/ros_images.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string_view>

#include "base/bytes.hpp"
#include "tests/io/bags/small_bag.hpp"

namespace twofold {
namespace {

using namespace testing;

constexpr std::array kEncodings{MessageEncoding::kRos1, MessageEncoding::kCdr};

std::string malformed(const std::function<void()>& call) {
  try {
    call();
  } catch (const MalformedBytes& error) {
    return error.what();
  }
  return "";
}

cv::Mat colourful() {
  cv::Mat image(kHeight, kWidth, CV_8UC3);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      image.at<cv::Vec3b>(y, x) = {static_cast<unsigned char>(2 * x), static_cast<unsigned char>(3 * y), 90};
  }
  return image;
}

double largest_difference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_INF);
}

cv::Mat grey_of(MessageEncoding encoding, const cv::Mat& image, const std::string& pixels) {
  const Bytes message = image_message(encoding, 5, image, pixels);
  const ImageMessage parsed = parse_image(message, encoding);
  EXPECT_EQ(parsed.t_ns, 5);
  return grey_image(parsed);
}

TEST(RosImages, EveryEncodingIsMadeGrey) {
  const cv::Mat bgr = colourful();
  cv::Mat grey, rgb, rgba, bgra, wide;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  cv::cvtColor(bgr, bgra, cv::COLOR_BGR2BGRA);
  cv::cvtColor(bgr, rgba, cv::COLOR_BGR2RGBA);
  grey.convertTo(wide, CV_16U, 256);
  for (const MessageEncoding encoding : kEncodings) {
    EXPECT_EQ(largest_difference(grey_of(encoding, grey, "mono8"), grey), 0);
    EXPECT_EQ(largest_difference(grey_of(encoding, bgr, "bgr8"), grey), 0);
    EXPECT_EQ(largest_difference(grey_of(encoding, rgb, "rgb8"), grey), 0);
    EXPECT_EQ(largest_difference(grey_of(encoding, bgra, "bgra8"), grey), 0);
    EXPECT_EQ(largest_difference(grey_of(encoding, rgba, "rgba8"), grey), 0);
    EXPECT_EQ(largest_difference(grey_of(encoding, wide, "mono16"), wide), 0);
  }
}

TEST(RosImages, EveryEncodingKeepsItsColours) {
  const cv::Mat bgr = colourful();
  cv::Mat grey, rgb, rgba, bgra, wide;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  cv::cvtColor(bgr, bgra, cv::COLOR_BGR2BGRA);
  cv::cvtColor(bgr, rgba, cv::COLOR_BGR2RGBA);
  grey.convertTo(wide, CV_16U, 256);
  for (const MessageEncoding encoding : kEncodings) {
    const auto colours = [&](const cv::Mat& image, const std::string& pixels) {
      return colour_image(parse_image(image_message(encoding, 5, image, pixels), encoding));
    };
    EXPECT_EQ(largest_difference(colours(bgr, "bgr8"), bgr), 0);
    EXPECT_EQ(largest_difference(colours(bgr, "8UC3"), bgr), 0);
    EXPECT_EQ(largest_difference(colours(rgb, "rgb8"), bgr), 0);
    EXPECT_EQ(largest_difference(colours(bgra, "bgra8"), bgr), 0);
    EXPECT_EQ(largest_difference(colours(rgba, "rgba8"), bgr), 0);
    EXPECT_TRUE(colours(grey, "mono8").empty());
    EXPECT_TRUE(colours(wide, "mono16").empty());
    EXPECT_NE(malformed([&] { (void)colours(bgr, "yuv422"); }).find("unknown encoding 'yuv422'"),
              std::string::npos);
    const auto unpacked = [&](const cv::Mat& image, const char* suffix) {
      Bytes file;
      cv::imencode(suffix, image, file);
      return colour_image(
          parse_compressed_image(compressed_image_message(encoding, 5, "some", file), encoding));
    };
    EXPECT_EQ(largest_difference(unpacked(bgr, ".png"), bgr), 0);
    EXPECT_LT(cv::norm(unpacked(bgr, ".jpg"), bgr, cv::NORM_L1) / (3.0 * kWidth * kHeight), 4);
    EXPECT_TRUE(unpacked(grey, ".png").empty());
    EXPECT_TRUE(unpacked(grey, ".jpg").empty());
  }
}

/// A camera with a colour filter sees one of three values a pixel, where and which the name says.
TEST(RosImages, BayerPatternsAreNamedByTheirFirstPixels) {
  const cv::Scalar blue_green_red(40, 120, 200);
  cv::Mat flat(kHeight, kWidth, CV_8UC3, blue_green_red), grey;
  cv::cvtColor(flat, grey, cv::COLOR_BGR2GRAY);
  for (const std::string pattern : {"rggb", "bggr", "gbrg", "grbg"}) {
    cv::Mat raw(kHeight, kWidth, CV_8UC1);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const char colour = pattern[static_cast<std::size_t>(2 * (y % 2) + x % 2)];
        raw.at<unsigned char>(y, x) = colour == 'b' ? 40 : colour == 'g' ? 120 : 200;
      }
    }
    const cv::Rect inside(2, 2, kWidth - 4, kHeight - 4);
    EXPECT_LE(largest_difference(grey_of(MessageEncoding::kRos1, raw, "bayer_" + pattern + "8")(inside),
                                 grey(inside)),
              1)
        << pattern;
    const Bytes message = image_message(MessageEncoding::kRos1, 5, raw, "bayer_" + pattern + "8");
    const cv::Mat colour = colour_image(parse_image(message, MessageEncoding::kRos1));
    EXPECT_LE(largest_difference(colour(inside), flat(inside)), 1) << pattern;
  }
}

TEST(RosImages, DepthIsInMillimetres) {
  cv::Mat metres(2, 3, CV_32FC1), units(2, 3, CV_16UC1);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::array values{1.0F, 2.5004F, nan, 0.0F, 70.0F, -1.0F};
  const std::array<std::uint16_t, 6> expected{1000, 2500, 0, 0, 0, 0};
  for (int i = 0; i < 6; ++i) {
    metres.at<float>(i / 3, i % 3) = values.at(static_cast<std::size_t>(i));
    units.at<std::uint16_t>(i / 3, i % 3) = expected.at(static_cast<std::size_t>(i));
  }
  for (const MessageEncoding encoding : kEncodings) {
    const Bytes of_metres = image_message(encoding, 0, metres, "32FC1");
    const Bytes of_units = image_message(encoding, 0, units, "16UC1");
    EXPECT_EQ(largest_difference(depth_image(parse_image(of_metres, encoding)), units), 0);
    EXPECT_EQ(largest_difference(depth_image(parse_image(of_units, encoding)), units), 0);
  }
}

/// The same image as a big-endian machine writes it.
cv::Mat turned_round(const cv::Mat& image) {
  cv::Mat turned = image.clone();
  const std::size_t size = image.elemSize1();
  for (std::size_t at = 0; at < image.total() * image.elemSize(); at += size)
    std::reverse(turned.data + at, turned.data + at + size);
  return turned;
}

TEST(RosImages, NumbersMayBeBigEndian) {
  cv::Mat wide(kHeight, kWidth, CV_16UC1), metres(kHeight, kWidth, CV_32FC1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      wide.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(1000 * y + x);
      metres.at<float>(y, x) = 0.5F + 0.01F * static_cast<float>(x + y);
    }
  }
  const auto parsed = [](const Bytes& message, bool big_endian) {
    ImageMessage image = parse_image(message, MessageEncoding::kRos1);
    image.big_endian = big_endian;
    return image;
  };
  for (const auto& [image, pixels] : {std::pair(wide, "16UC1"), std::pair(metres, "32FC1")}) {
    const Bytes little = image_message(MessageEncoding::kRos1, 0, image, pixels);
    const Bytes big = image_message(MessageEncoding::kRos1, 0, turned_round(image), pixels);
    EXPECT_EQ(largest_difference(depth_image(parsed(big, true)), depth_image(parsed(little, false))), 0);
  }
  const Bytes little = image_message(MessageEncoding::kRos1, 0, wide, "mono16");
  const Bytes big = image_message(MessageEncoding::kRos1, 0, turned_round(wide), "mono16");
  EXPECT_EQ(largest_difference(grey_image(parsed(big, true)), grey_image(parsed(little, false))), 0);
  const cv::Mat grey = numbered_image(kWidth, kHeight, 9);  // single bytes have no order
  const Bytes bytes = image_message(MessageEncoding::kRos1, 0, grey, "mono8");
  EXPECT_EQ(largest_difference(grey_image(parsed(bytes, true)), grey), 0);
}

TEST(RosImages, CompressedOnesAreDecoded) {
  const cv::Mat grey = numbered_image(kWidth, kHeight, 77);
  cv::Mat depth(kHeight, kWidth, CV_16UC1, cv::Scalar(1234));
  Bytes png, deep;
  cv::imencode(".png", grey, png);
  cv::imencode(".png", depth, deep);
  Bytes headed(12 + deep.size());
  std::copy(deep.begin(), deep.end(), headed.begin() + 12);
  for (const MessageEncoding encoding : kEncodings) {
    const auto parsed = [&](const Bytes& message) { return parse_compressed_image(message, encoding); };
    const Bytes image = compressed_image_message(encoding, 9, "mono8; png compressed ", png);
    EXPECT_EQ(parsed(image).t_ns, 9);
    EXPECT_EQ(largest_difference(grey_image(parsed(image)), grey), 0);
    const Bytes plain = compressed_image_message(encoding, 0, "png", deep);
    EXPECT_EQ(largest_difference(depth_image(parsed(plain)), depth), 0);
    const Bytes by_ros = compressed_image_message(encoding, 0, "16UC1; compressedDepth png", headed);
    EXPECT_EQ(largest_difference(depth_image(parsed(by_ros)), depth), 0);
    const Bytes cut = compressed_image_message(encoding, 0, "png", Bytes(png.begin(), png.end() - 20));
    EXPECT_NE(malformed([&] { (void)grey_image(parsed(cut)); }).find("a compressed image"),
              std::string::npos);
    const Bytes inverse = compressed_image_message(encoding, 0, "32FC1; compressedDepth png", headed);
    EXPECT_NE(malformed([&] { (void)depth_image(parsed(inverse)); }).find("16UC1 can be read"),
              std::string::npos);
  }
}

/// A telephone that was held upside down: camera_info is of the sensor's rows.
TEST(RosImages, RowsAreThoseOfTheSensorWhateverExifSays) {
  cv::Mat image(kHeight, kWidth, CV_8UC1, cv::Scalar(20));
  image.rowRange(0, kHeight / 2).setTo(220);
  Bytes jpeg;
  cv::imencode(".jpg", image, jpeg);
  // One entry in big-endian TIFF: orientation (0x0112), short, 3.
  constexpr std::string_view kExif(
      "\xff\xe1\0\x22"
      "Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0",
      36);
  jpeg.insert(jpeg.begin() + 2, kExif.begin(), kExif.end());
  ASSERT_LT(cv::mean(cv::imdecode(jpeg, cv::IMREAD_GRAYSCALE).rowRange(0, 15))[0], 40)
      << "the file says that it is upside down";
  const Bytes message = compressed_image_message(MessageEncoding::kRos1, 0, "jpeg", jpeg);
  const cv::Mat grey = grey_image(parse_compressed_image(message, MessageEncoding::kRos1));
  EXPECT_GT(cv::mean(grey.rowRange(0, 15))[0], 200);
}

TEST(RosImages, SizesAreNotBelieved) {
  const cv::Mat image = numbered_image(kWidth, kHeight, 1);
  const Bytes message = image_message(MessageEncoding::kRos1, 0, image, "mono8");
  ImageMessage parsed = parse_image(message, MessageEncoding::kRos1);
  parsed.width = 10'000;
  EXPECT_NE(malformed([&] { (void)grey_image(parsed); }).find("shorter than its width"), std::string::npos);
  parsed.width = parsed.height = 1U << 31;
  EXPECT_NE(malformed([&] { (void)grey_image(parsed); }).find("impossible size"), std::string::npos);
  parsed = parse_image(message, MessageEncoding::kRos1);
  parsed.encoding = "yuv422";
  EXPECT_NE(malformed([&] { (void)grey_image(parsed); }).find("unknown encoding 'yuv422'"),
            std::string::npos);
  for (std::size_t size = 0; size < message.size(); ++size) {
    const std::span<const std::uint8_t> cut(message.data(), size);
    EXPECT_NE(malformed([&] { (void)parse_image(cut, MessageEncoding::kRos1); }), "") << size;
  }
}

TEST(RosMessages, CameraInfoIsReadInEitherEncoding) {
  WrittenCameraInfo written = rectified_info(true);
  written.D = {0.1, -0.2, 0.001, 0.002, 0.05};
  for (const MessageEncoding encoding : kEncodings) {
    const Bytes message = camera_info_message(encoding, written);
    const CameraInfoMessage info = parse_camera_info(message, encoding);
    EXPECT_EQ(info.width, static_cast<std::uint32_t>(kWidth));
    EXPECT_EQ(info.height, static_cast<std::uint32_t>(kHeight));
    EXPECT_EQ(info.distortion_model, "plumb_bob");
    EXPECT_EQ(info.D, written.D);
    EXPECT_EQ(info.K, written.K);
    EXPECT_EQ(info.R, written.R);
    EXPECT_EQ(info.P, written.P);
  }
  Bytes parameter_list = camera_info_message(MessageEncoding::kCdr, written);
  parameter_list[1] = 3;
  EXPECT_NE(
      malformed([&] { (void)parse_camera_info(parameter_list, MessageEncoding::kCdr); }).find("no plain CDR"),
      std::string::npos);
}

TEST(RosMessages, CdrMayBeBigEndian) {
  const Bytes message{0,   0,   0,   0,                                // CDR, big-endian
                      0,   0,   0,   5, 0,   0,   0,   7, 0, 0, 0, 4,  // 5 s and 7 ns, a name of four bytes
                      'c', 'a', 'm', 0,                                //
                      0,   0,   0,   4, 'p', 'n', 'g', 0,              // format
                      0,   0,   0,   2, 11,  12};                      // file
  const CompressedImageMessage image = parse_compressed_image(message, MessageEncoding::kCdr);
  EXPECT_EQ(image.t_ns, 5'000'000'007);
  EXPECT_EQ(image.format, "png");
  EXPECT_EQ(Bytes(image.file.begin(), image.file.end()), (Bytes{11, 12}));
}

}  // namespace
}  // namespace twofold
