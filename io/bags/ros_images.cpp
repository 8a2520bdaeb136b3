#include "io/bags/ros_images.hpp"

#include <algorithm>
#include <bit>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string_view>

#include "base/bytes.hpp"
#include "camera/metric_depth.hpp"
#include "io/files/image_file.hpp"
#include "io/files/image_integrity.hpp"

namespace twofold {
namespace {

static_assert(std::endian::native == std::endian::little, "native_copy turns big-endian numbers round");

struct Encoding {
  int type = 0;      ///< OpenCV's
  int to_grey = -1;  ///< OpenCV's conversion; -1: none is needed, it has no colour
  int to_bgr = -1;   ///< likewise; -1: none is needed, or it has no colour
};

/// OpenCV names Bayer patterns by the second row's second and third pixel: its BG is rggb.
const std::map<std::string, Encoding, std::less<>>& encodings() {
  static const std::map<std::string, Encoding, std::less<>> kEncodings{
      {"mono8", {CV_8UC1}},
      {"8UC1", {CV_8UC1}},
      {"mono16", {CV_16UC1}},
      {"16UC1", {CV_16UC1}},
      {"32FC1", {CV_32FC1}},
      {"rgb8", {CV_8UC3, cv::COLOR_RGB2GRAY, cv::COLOR_RGB2BGR}},
      {"bgr8", {CV_8UC3, cv::COLOR_BGR2GRAY}},
      {"8UC3", {CV_8UC3, cv::COLOR_BGR2GRAY}},
      {"rgba8", {CV_8UC4, cv::COLOR_RGBA2GRAY, cv::COLOR_RGBA2BGR}},
      {"bgra8", {CV_8UC4, cv::COLOR_BGRA2GRAY, cv::COLOR_BGRA2BGR}},
      {"bayer_rggb8", {CV_8UC1, cv::COLOR_BayerBG2GRAY, cv::COLOR_BayerBG2BGR}},
      {"bayer_bggr8", {CV_8UC1, cv::COLOR_BayerRG2GRAY, cv::COLOR_BayerRG2BGR}},
      {"bayer_gbrg8", {CV_8UC1, cv::COLOR_BayerGR2GRAY, cv::COLOR_BayerGR2BGR}},
      {"bayer_grbg8", {CV_8UC1, cv::COLOR_BayerGB2GRAY, cv::COLOR_BayerGB2BGR}},
  };
  return kEncodings;
}

/// The message's pixels as they are; valid as long as those.
cv::Mat view_of(const ImageMessage& image, Encoding& encoding) {
  const auto known = encodings().find(image.encoding);
  if (known == encodings().end())
    throw MalformedBytes("an image of unknown encoding '" + image.encoding + "'");
  encoding = known->second;
  const std::size_t pixel = CV_ELEM_SIZE(encoding.type);
  if (image.width == 0 || image.height == 0 ||
      std::uint64_t{image.width} * image.height > static_cast<std::uint64_t>(kMaxImagePixels))
    throw MalformedBytes("an image of impossible size");
  if (image.step < image.width * pixel || image.step > 4 * std::uint64_t{kMaxImagePixels})
    throw MalformedBytes("an image whose rows are shorter than its width");
  // OpenCV has no view of what must not be written; nobody writes.
  return {static_cast<int>(image.height), static_cast<int>(image.width), encoding.type,
          const_cast<std::uint8_t*>(image.pixels.data()), image.step};
}

/// Rows may begin at any byte, and wide numbers in either order: a copy that OpenCV can read.
cv::Mat native_copy(const cv::Mat& view, bool big_endian) {
  cv::Mat copy(view.size(), view.type());
  const auto row_size = static_cast<std::ptrdiff_t>(static_cast<std::size_t>(view.cols) * view.elemSize());
  const auto number_size = static_cast<std::ptrdiff_t>(view.elemSize1());
  for (int y = 0; y < view.rows; ++y) {
    std::uint8_t* const row = copy.ptr(y);
    std::copy(view.ptr(y), view.ptr(y) + row_size, row);
    if (!big_endian || number_size == 1) continue;
    for (std::ptrdiff_t at = 0; at < row_size; at += number_size)
      std::reverse(row + at, row + at + number_size);
  }
  return copy;
}

cv::Mat decode(std::span<const std::uint8_t> file, int flags) {
  if (const std::string defect = image_defect(file); !defect.empty())
    throw MalformedBytes("a compressed image " + defect);
  cv::Mat image;
  try {
    image = cv::imdecode(
        cv::Mat(1, static_cast<int>(file.size()), CV_8UC1, const_cast<std::uint8_t*>(file.data())),
        flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {  // empty image below
  }
  if (image.empty()) throw MalformedBytes("a compressed image that cannot be decoded");
  return image;
}

/// Behind the 12 bytes of compressedDepth's parameters, if they are there.
std::span<const std::uint8_t> without_depth_header(const CompressedImageMessage& image) {
  constexpr std::size_t kHeader = 12;
  const bool headed = image.format.find("compressedDepth") != std::string::npos;
  if (headed && image.format.find("16UC1") == std::string::npos)
    throw MalformedBytes("a compressed depth image of '" + image.format + "': 16UC1 can be read");
  if (!headed) return image.file;
  if (image.file.size() < kHeader) throw MalformedBytes("a compressed depth image without an image");
  return image.file.subspan(kHeader);
}

}  // namespace

cv::Mat grey_image(const ImageMessage& image) {
  Encoding encoding;
  const cv::Mat view = view_of(image, encoding);
  if (encoding.type == CV_32FC1) throw MalformedBytes("an image of encoding 32FC1 where grey is wanted");
  cv::Mat grey;
  if (encoding.to_grey >= 0) {
    cv::cvtColor(view, grey, encoding.to_grey);
  } else {
    grey = native_copy(view, image.big_endian);
  }
  return grey;
}

cv::Mat grey_image(const CompressedImageMessage& image) {
  cv::Mat grey = decode(image.file, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH);
  if (grey.type() != CV_8UC1 && grey.type() != CV_16UC1)
    throw MalformedBytes("a compressed image that has neither 8 nor 16 bits");
  return grey;
}

cv::Mat colour_image(const ImageMessage& image) {
  Encoding encoding;
  const cv::Mat view = view_of(image, encoding);
  if (encoding.to_grey < 0) return {};
  if (encoding.to_bgr < 0) return view.clone();
  cv::Mat bgr;
  cv::cvtColor(view, bgr, encoding.to_bgr);
  return bgr;
}

cv::Mat colour_image(const CompressedImageMessage& image) {
  const cv::Mat bgr = decode(image.file, cv::IMREAD_ANYCOLOR);
  return bgr.type() == CV_8UC3 ? bgr : cv::Mat();
}

cv::Mat depth_image(const ImageMessage& image, double unit) {
  Encoding encoding;
  cv::Mat depth = native_copy(view_of(image, encoding), image.big_endian);
  if (encoding.type == CV_16UC1) return depth;
  if (encoding.type != CV_32FC1) throw MalformedBytes("a depth image of encoding '" + image.encoding + "'");
  return in_depth_units(depth, unit);
}

cv::Mat depth_image(const CompressedImageMessage& image) {
  cv::Mat depth = decode(without_depth_header(image), cv::IMREAD_UNCHANGED);
  if (depth.type() != CV_16UC1) throw MalformedBytes("a compressed depth image without 16 bits a pixel");
  return depth;
}

}  // namespace twofold
