#include "viewer/image_message.hpp"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace twofold {
namespace {

constexpr int kWidth = 480;
constexpr int kQuality = 75;

/// A view of the pixels; nobody writes through it.
cv::Mat mat_of(const ImageView& image) {
  const int type = image.format == ImageFormat::kGrey8 ? CV_8UC1 : CV_8UC3;
  return {image.height, image.width, type, const_cast<void*>(image.data),
          static_cast<std::size_t>(image.stride)};
}

std::vector<std::uint8_t> jpeg_of(const ImageView& image) {
  cv::Mat shown = mat_of(image);
  if (image.width > kWidth)
    cv::resize(shown, shown, {kWidth, image.height * kWidth / image.width}, 0, 0, cv::INTER_AREA);
  if (image.format == ImageFormat::kRgb8) cv::cvtColor(shown, shown, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", shown, jpeg, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return jpeg;
}

}  // namespace

std::string image_message(ViewMessageKind kind, std::int64_t number, const ImageView& image) {
  std::vector<std::uint8_t> jpeg;
  if (image.data != nullptr) jpeg = jpeg_of(image);
  const ViewMessageHeader header{kind, static_cast<std::uint32_t>(number),
                                 static_cast<std::uint32_t>(image.width),
                                 static_cast<std::uint32_t>(image.height)};
  std::string message(reinterpret_cast<const char*>(&header), sizeof header);
  message.append(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  return message;
}

}  // namespace twofold
