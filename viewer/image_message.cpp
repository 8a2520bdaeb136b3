#include "viewer/image_message.hpp"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace twofold {
namespace {

constexpr int kWidth = 480;
constexpr int kQuality = 75;
constexpr int kMaxSide = 1 << 15;  // [px]

/// A view of the pixels; nobody writes through it.
cv::Mat mat_of(const ImageView& image) {
  const int type = image.format == ImageFormat::kGrey8 ? CV_8UC1 : CV_8UC3;
  return {image.height, image.width, type, const_cast<void*>(image.data),
          static_cast<std::size_t>(image.stride)};
}

int bytes_a_pixel(ImageFormat format) {
  switch (format) {
    case ImageFormat::kGrey8:
      return 1;
    case ImageFormat::kRgb8:
    case ImageFormat::kBgr8:
      return 3;
    case ImageFormat::kDepth16:
    case ImageFormat::kDepth32F:
      break;
  }
  return 0;
}

std::vector<std::uint8_t> jpeg_of(const ImageView& image) {
  cv::Mat shown = mat_of(image);
  if (image.width > kWidth)
    cv::resize(shown, shown,
               {kWidth, std::max(1, static_cast<int>(std::int64_t{image.height} * kWidth / image.width))}, 0,
               0, cv::INTER_AREA);
  if (image.format == ImageFormat::kRgb8) cv::cvtColor(shown, shown, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", shown, jpeg, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return jpeg;
}

}  // namespace

bool can_be_shown(const ImageView& image) {
  const int pixel = bytes_a_pixel(image.format);
  return image.data != nullptr && pixel > 0 && image.width > 0 && image.height > 0 &&
         image.width <= kMaxSide && image.height <= kMaxSide &&
         image.stride >= static_cast<std::ptrdiff_t>(image.width) * pixel;
}

std::string image_message(ViewMessageKind kind, std::int64_t number, const ImageView& image) {
  std::vector<std::uint8_t> jpeg;
  if (can_be_shown(image)) jpeg = jpeg_of(image);
  const ViewMessageHeader header{kind, static_cast<std::uint32_t>(number),
                                 static_cast<std::uint32_t>(image.width),
                                 static_cast<std::uint32_t>(image.height)};
  std::string message(reinterpret_cast<const char*>(&header), sizeof header);
  message.append(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  return message;
}

}  // namespace twofold
