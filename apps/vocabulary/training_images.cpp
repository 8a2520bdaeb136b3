#include "apps/vocabulary/training_images.hpp"

#include <algorithm>
#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/open_source.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;
using UseImage = std::function<void(const cv::Mat&)>;

constexpr int kTrainingSide = 1024;  // longer side of a training image [px]

/// A photograph as a whole, and its quarters at twice the scale if it has the pixels: one image would show a
/// few things only, and only as they look from afar.
void use_photograph(const cv::Mat& image, const UseImage& use) {
  use(reduced(image));
  if (std::max(image.cols, image.rows) < 2 * kTrainingSide) return;
  const cv::Size half(image.cols / 2, image.rows / 2);
  for (const cv::Point corner : {cv::Point(0, 0), cv::Point(half.width, 0), cv::Point(0, half.height),
                                 cv::Point(half.width, half.height)}) {
    use(reduced(image(cv::Rect(corner, half))));
  }
}

}  // namespace

std::vector<DescribedCorner> ImageDescriber::describe(const cv::Mat& image) {
  pyramid_.build(image);
  std::vector<DescribedCorner> corners;
  selector_.select(pyramid_, corners);
  describer_.describe(pyramid_, corners);
  return corners;
}

cv::Mat reduced(const cv::Mat& image) {
  const double scale = static_cast<double>(kTrainingSide) / std::max(image.cols, image.rows);
  if (scale >= 1) return image;
  cv::Mat small;
  cv::resize(image, small, cv::Size(), scale, scale, cv::INTER_AREA);
  return small;
}

void for_each_image(const std::string& input, int every, const UseImage& use) {
  if (fs::is_regular_file(input)) return use_photograph(read_grey_image(input), use);
  if (fs::is_directory(input)) {
    const std::vector<fs::path> files = list_images(input);
    for (std::size_t i = 0; i < files.size(); i += static_cast<std::size_t>(every)) {
      use_photograph(read_grey_image(files[i]), use);
    }
    return;
  }
  const auto source = open_source(input);
  Frame frame;
  FrameStatus status;
  while ((status = source->next(frame)) == FrameStatus::kFrame) {
    if (frame.index % every == 0) use(frame.left);
  }
  if (status == FrameStatus::kError) throw IoError(source->error());
}

}  // namespace twofold
