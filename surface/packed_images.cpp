#include "surface/packed_images.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "base/check.hpp"
#include "base/right_of_way.hpp"

namespace twofold {
namespace {

static_assert(std::endian::native == std::endian::little, "bits are read from the lowest byte on");

// A group is a byte, the width of its codes in bits, then the codes, the first of them in the lowest bits.
constexpr int kGroup = 16;           // pixels of a row
constexpr std::size_t kPadding = 8;  // bytes behind the last code, since each is read from eight bytes

std::size_t bytes_of_codes(int width) {
  return static_cast<std::size_t>(kGroup / 8 * width);
}

/// Pixels and their codes: 0 without a reading, else one more than the difference to the row's reading
/// before, small ones of either sign being small numbers. So holes cost their neighbours nothing.
class Differences {
 public:
  std::uint32_t encode(std::uint16_t reading) {
    if (reading == 0) return 0;
    const auto difference = static_cast<std::int16_t>(reading - before_);
    before_ = reading;
    return 1U + static_cast<std::uint16_t>((difference << 1) ^ (difference >> 15));
  }
  std::uint16_t decode(std::uint32_t code) {
    if (code == 0) return 0;
    const std::uint32_t folded = code - 1;
    before_ = static_cast<std::uint16_t>(before_ + ((folded >> 1) ^ (0U - (folded & 1U))));
    return before_;
  }

 private:
  std::uint16_t before_ = 0;
};

/// Up to 17 bits each.
void append_codes(const std::array<std::uint32_t, kGroup>& codes, std::vector<std::uint8_t>& bytes) {
  const int width = std::bit_width(*std::max_element(codes.begin(), codes.end()));
  bytes.push_back(static_cast<std::uint8_t>(width));
  std::uint64_t bits = 0;
  int count = 0;
  for (const std::uint32_t code : codes) {
    bits |= std::uint64_t{code} << count;
    for (count += width; count >= 8; count -= 8, bits >>= 8)
      bytes.push_back(static_cast<std::uint8_t>(bits & 0xff));
  }
}

constexpr int kJpegQuality = 92;
constexpr int kStrip = 64;  // rows: whole blocks of JPEG's; each strip's tables take 600 bytes

cv::Mat strip(const cv::Mat& image, int first) {
  return image.rowRange(first, std::min(first + kStrip, image.rows));
}

}  // namespace

PackedDepth::PackedDepth(const cv::Mat& depth) : rows_(depth.rows), cols_(depth.cols) {
  TWOFOLD_CHECK(depth.type() == CV_16UC1 && !depth.empty(), "a depth image of 16 bits");
  bytes_.reserve(2 * depth.total());
  for (int y = 0; y < rows_; ++y) {
    make_way();
    const auto* row = depth.ptr<std::uint16_t>(y);
    Differences differences;
    for (int x = 0; x < cols_; x += kGroup) {
      std::array<std::uint32_t, kGroup> codes{};
      for (int i = 0; i < std::min(kGroup, cols_ - x); ++i)
        codes[static_cast<std::size_t>(i)] = differences.encode(row[x + i]);
      append_codes(codes, bytes_);
    }
  }
  bytes_.resize(bytes_.size() + kPadding);
  bytes_.shrink_to_fit();
}

cv::Mat PackedDepth::unpacked() const {
  cv::Mat depth(rows_, cols_, CV_16UC1);
  const std::uint8_t* from = bytes_.data();
  for (int y = 0; y < rows_; ++y) {
    make_way();
    auto* row = depth.ptr<std::uint16_t>(y);
    Differences differences;
    for (int x = 0; x < cols_; x += kGroup) {
      const int width = *from++;
      const std::uint64_t mask = (std::uint64_t{1} << width) - 1;
      for (int i = 0; i < std::min(kGroup, cols_ - x); ++i) {
        std::uint64_t bits = 0;
        std::memcpy(&bits, from + i * width / 8, sizeof(bits));
        row[x + i] = differences.decode(static_cast<std::uint32_t>(bits >> (i * width % 8) & mask));
      }
      from += bytes_of_codes(width);
    }
  }
  return depth;
}

PackedColour::PackedColour(const cv::Mat& image) : rows_(image.rows), cols_(image.cols), type_(image.type()) {
  TWOFOLD_CHECK((type_ == CV_8UC1 || type_ == CV_8UC3) && !image.empty(), "an image of 8 bits");
  for (int y = 0; y < rows_; y += kStrip) {
    make_way();
    strips_.emplace_back();
    (void)cv::imencode(".jpg", strip(image, y), strips_.back(), {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  }
}

cv::Mat PackedColour::unpacked() const {
  if (empty()) return {};
  cv::Mat image(rows_, cols_, type_);
  for (std::size_t n = 0; n < strips_.size(); ++n) {
    make_way();
    cv::imdecode(strips_[n], cv::IMREAD_UNCHANGED).copyTo(strip(image, static_cast<int>(n) * kStrip));
  }
  return image;
}

std::size_t PackedColour::bytes() const {
  std::size_t sum = 0;
  for (const auto& bytes : strips_) sum += bytes.size();
  return sum;
}

}  // namespace twofold
