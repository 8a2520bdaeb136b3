#include "io/files/image_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string_view>
#include <tuple>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/files/grey_levels.hpp"
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
    image = cv::imdecode(bytes, flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {  // empty image below
  }
  if (image.empty()) throw IoError(file, "the image cannot be decoded");
  return image;
}

constexpr std::array<const char*, 9> kExtensions{".png", ".jpg",  ".jpeg", ".pgm", ".ppm",
                                                 ".tif", ".tiff", ".bmp",  ".webp"};

/// Not the files "._NAME" that macOS lays beside those of other file systems.
bool is_image_file(const fs::path& file) {
  if (file.filename().string().starts_with("._")) return false;
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// Takes the digits that `text` begins with; without zeros before them, so that the longer is the larger.
std::string_view take_number(std::string_view& text) {
  const auto end = std::find_if_not(text.begin(), text.end(), is_digit);
  std::string_view digits = text.substr(0, static_cast<std::size_t>(end - text.begin()));
  text.remove_prefix(digits.size());
  digits.remove_prefix(std::min(digits.find_first_not_of('0'), digits.size()));
  return digits;
}

/// Numbers by their value, 2.png before 10.png; all else as text.
bool precedes(std::string_view a, std::string_view b) {
  while (!a.empty() && !b.empty()) {
    if (is_digit(a.front()) && is_digit(b.front())) {
      const std::string_view m = take_number(a), n = take_number(b);
      if (m.size() != n.size()) return m.size() < n.size();
      if (m != n) return m < n;
    } else {
      if (a.front() != b.front()) return a.substr(0, 1) < b.substr(0, 1);  // as bytes without a sign
      a.remove_prefix(1);
      b.remove_prefix(1);
    }
  }
  return a.size() < b.size();
}

/// Names that differ in zeros only, as 1.png and 01.png, are in order of their text.
bool file_precedes(const fs::path& a, const fs::path& b) {
  const std::string first = a.filename().string(), second = b.filename().string();
  if (precedes(first, second)) return true;
  return !precedes(second, first) && first < second;
}

/// What compares decimal numbers by value: digits before the point, how many first, and those behind it.
using Decimal = std::tuple<std::size_t, std::string, std::string>;

std::optional<Decimal> decimal(const std::string& text) {
  std::string_view rest = text;
  const std::size_t point = rest.find('.');
  const std::string_view whole = take_number(rest);
  if (rest.empty()) return text.empty() ? std::nullopt : std::optional(Decimal{whole.size(), whole, ""});
  if (point == 0 || point + 1 == text.size() || !rest.starts_with('.')) return std::nullopt;
  std::string_view fraction = rest.substr(1);
  if (!std::all_of(fraction.begin(), fraction.end(), is_digit)) return std::nullopt;
  fraction = fraction.substr(0, fraction.find_last_not_of('0') + 1);
  return Decimal{whole.size(), whole, fraction};
}

/// When all names are decimal numbers of different values, as times that are not padded are: 10.15.jpg before
/// 10.5.jpg. Two of one value, 1.1 and 1.10, count something else.
bool sort_by_decimals(std::vector<fs::path>& files) {
  std::map<Decimal, fs::path> sorted;
  for (const fs::path& file : files) {
    const auto value = decimal(file.stem().string());
    if (!value || !sorted.emplace(*value, file).second) return false;
  }
  std::transform(sorted.begin(), sorted.end(), files.begin(), [](const auto& entry) { return entry.second; });
  return true;
}

}  // namespace

cv::Mat read_grey_image(const fs::path& file, int bits) {
  if (bits >= 16) return decode(file, cv::IMREAD_GRAYSCALE);
  return eight_bits(decode(file, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH), bits);
}

std::optional<int> bits_used(const fs::path& file) {
  return wide_bits(decode(file, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH));
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
    if (is_image_file(entry.path())) files.push_back(entry.path());
  }
  if (files.empty())
    throw IoError(
        folder, fmt::format("the folder holds no images (files ending in {})", fmt::join(kExtensions, ", ")));
  sort_images(files);
  return files;
}

void sort_images(std::vector<fs::path>& files) {
  if (!sort_by_decimals(files)) std::sort(files.begin(), files.end(), file_precedes);
}

void expect_size(const fs::path& file, const cv::Mat& image, const PinholeCamera& camera,
                 const std::string& said_by) {
  if (image.cols == camera.width && image.rows == camera.height) return;
  throw IoError(file, fmt::format("the image is {}x{}, {} {}x{}", image.cols, image.rows, said_by,
                                  camera.width, camera.height));
}

std::string size_of_calibration(const fs::path& file) {
  return fmt::format("the calibration ({}) is for", file.string());
}

std::string size_of_image(const fs::path& first) {
  return fmt::format("the first image ({}) is", first.string());
}

}  // namespace twofold
