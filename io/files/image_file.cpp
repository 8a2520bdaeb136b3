#include "io/files/image_file.hpp"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include <fmt/format.h>

#include "io/files/image_integrity.hpp"
#include "io/files/io_error.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

std::vector<unsigned char> read_bytes(const fs::path& file) {
  std::error_code error;
  const auto size = fs::file_size(file, error);
  if (error) throw IoError(file, "no such image file");
  std::vector<unsigned char> bytes(size);
  std::ifstream stream(file, std::ios::binary);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!stream) throw IoError(file, "cannot be read");
  return bytes;
}

cv::Mat decode(const fs::path& file, int flags) {
  const auto bytes = read_bytes(file);
  if (const auto defect = image_defect(bytes); !defect.empty()) throw IoError(file, "the image " + defect);
  cv::Mat image;
  try {
    image = cv::imdecode(bytes, flags);
  } catch (const cv::Exception&) {  // empty image below
  }
  if (image.empty()) throw IoError(file, "the image cannot be decoded");
  return image;
}

bool has_image_extension(const fs::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const char* known : {".png", ".jpg", ".jpeg", ".pgm", ".tif", ".tiff", ".bmp"}) {
    if (extension == known) return true;
  }
  return false;
}

}  // namespace

cv::Mat read_grey_image(const fs::path& file) {
  return decode(file, cv::IMREAD_GRAYSCALE);
}

cv::Mat read_colour_image(const fs::path& file) {
  const cv::Mat image = decode(file, cv::IMREAD_ANYCOLOR);  // 8 bits
  return image.channels() == 3 ? image : cv::Mat();
}

cv::Mat read_depth_image(const fs::path& file) {
  cv::Mat image = decode(file, cv::IMREAD_UNCHANGED);
  if (image.type() != CV_16UC1) {
    throw IoError(file, fmt::format("a depth image has one channel of 16 bits, this one has {} of {}",
                                    image.channels(), 8 * image.elemSize1()));
  }
  return image;
}

std::vector<fs::path> list_images(const fs::path& folder) {
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  if (error) throw IoError(folder, "no such folder, or it cannot be read");
  std::vector<fs::path> files;
  for (const auto& entry : entries) {
    if (has_image_extension(entry.path())) files.push_back(entry.path());
  }
  if (files.empty()) throw IoError(folder, "the folder holds no images");
  std::sort(files.begin(), files.end());
  return files;
}

void expect_size(const fs::path& file, const cv::Mat& image, const PinholeCamera& camera) {
  if (image.cols == camera.width && image.rows == camera.height) return;
  throw IoError(file, fmt::format("the image is {}x{}, the calibration or the first image says {}x{}",
                                  image.cols, image.rows, camera.width, camera.height));
}

}  // namespace twofold
