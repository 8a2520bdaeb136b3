#include "surface/packed_depth.hpp"

#include <zlib.h>

#include "base/check.hpp"
#include "base/right_of_way.hpp"

namespace twofold {

PackedDepth::PackedDepth(const cv::Mat& depth) : rows_(depth.rows), cols_(depth.cols) {
  TWOFOLD_CHECK(depth.type() == CV_16UC1 && !depth.empty(), "a depth image of 16 bits");
  const std::size_t pixels = depth.total();
  std::vector<std::uint8_t> plain(2 * pixels);
  std::size_t i = 0;
  for (int y = 0; y < rows_; ++y) {
    make_way();
    const auto* row = depth.ptr<std::uint16_t>(y);
    std::uint16_t before = 0;
    for (int x = 0; x < cols_; ++x, ++i) {
      const auto difference = static_cast<std::uint16_t>(row[x] - before);
      // Small differences of either sign get a high byte of 0.
      const auto folded =
          static_cast<std::uint16_t>((difference << 1) ^ ((difference & 0x8000) != 0 ? 0xffff : 0));
      before = row[x];
      plain[i] = static_cast<std::uint8_t>(folded);
      plain[pixels + i] = static_cast<std::uint8_t>(folded >> 8);
    }
  }
  uLongf size = compressBound(plain.size());
  bytes_.resize(size);
  TWOFOLD_CHECK(compress2(bytes_.data(), &size, plain.data(), plain.size(), Z_BEST_SPEED) == Z_OK,
                "there is room for the packed depth");
  bytes_.resize(size);
  bytes_.shrink_to_fit();
}

cv::Mat PackedDepth::unpacked() const {
  cv::Mat depth(rows_, cols_, CV_16UC1);
  const std::size_t pixels = depth.total();
  std::vector<std::uint8_t> plain(2 * pixels);
  uLongf size = plain.size();
  TWOFOLD_CHECK(uncompress(plain.data(), &size, bytes_.data(), bytes_.size()) == Z_OK && size == plain.size(),
                "packed depth is whole");
  std::size_t i = 0;
  for (int y = 0; y < rows_; ++y) {
    make_way();
    auto* row = depth.ptr<std::uint16_t>(y);
    std::uint16_t before = 0;
    for (int x = 0; x < cols_; ++x, ++i) {
      const unsigned folded = plain[i] | static_cast<unsigned>(plain[pixels + i]) << 8;
      const unsigned difference = (folded >> 1) ^ ((folded & 1U) != 0 ? 0xffffU : 0U);
      before = row[x] = static_cast<std::uint16_t>(before + difference);
    }
  }
  return depth;
}

}  // namespace twofold
