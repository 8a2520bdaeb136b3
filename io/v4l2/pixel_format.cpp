#include "io/v4l2/pixel_format.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "io/v4l2/jpeg.hpp"

namespace twofold {
namespace {

static_assert(std::endian::native == std::endian::little, "Y16 and Z16 are copied as they are");

struct PixelFormatEntry {
  PixelFormat format;
  std::uint32_t fourcc;
  const char* name;
  std::size_t pixel_bytes;  // of the first plane; 0: compressed
};

constexpr std::array<PixelFormatEntry, 7> kFormats{{
    {PixelFormat::kGrey, V4L2_PIX_FMT_GREY, "GREY", 1},
    {PixelFormat::kNv12, V4L2_PIX_FMT_NV12, "NV12", 1},
    {PixelFormat::kYuyv, V4L2_PIX_FMT_YUYV, "YUYV", 2},
    {PixelFormat::kUyvy, V4L2_PIX_FMT_UYVY, "UYVY", 2},
    {PixelFormat::kY16, V4L2_PIX_FMT_Y16, "Y16", 2},
    {PixelFormat::kZ16, V4L2_PIX_FMT_Z16, "Z16", 2},
    {PixelFormat::kMjpg, V4L2_PIX_FMT_MJPEG, "MJPG", 0},
}};

const PixelFormatEntry& entry(PixelFormat format) {
  return *std::find_if(kFormats.begin(), kFormats.end(),
                       [&](const PixelFormatEntry& e) { return e.format == format; });
}

/// Every kStep-th byte of a row; constant steps, so that the compiler makes shuffles of it.
template <int kStep>
void take_bytes(const std::uint8_t* from, int count, std::uint8_t* to) {
  for (int i = 0; i < count; ++i) to[i] = from[kStep * i];
}

}  // namespace

std::span<const PixelFormat> pixel_formats() {
  static constexpr auto kOrder = [] {
    std::array<PixelFormat, kFormats.size()> order{};
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = kFormats[i].format;
    return order;
  }();
  return kOrder;
}

std::uint32_t fourcc(PixelFormat format) {
  return entry(format).fourcc;
}

const char* name(PixelFormat format) {
  return entry(format).name;
}

std::optional<PixelFormat> pixel_format_from_fourcc(std::uint32_t fourcc) {
  if (fourcc == V4L2_PIX_FMT_JPEG) return PixelFormat::kMjpg;  // some drivers say JPEG and mean the same
  for (const PixelFormatEntry& e : kFormats) {
    if (e.fourcc == fourcc) return e.format;
  }
  return std::nullopt;
}

std::optional<PixelFormat> pixel_format_from_name(const std::string& name) {
  for (const PixelFormatEntry& e : kFormats) {
    if (name == e.name) return e.format;
  }
  return std::nullopt;
}

std::string fourcc_text(std::uint32_t fourcc) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) {
    const char letter = static_cast<char>((fourcc >> shift) & 0x7f);
    text += letter >= ' ' && letter < 0x7f ? letter : '?';
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

std::size_t ImageLayout::row_bytes() const {
  return entry(format).pixel_bytes * static_cast<std::size_t>(width);
}

std::size_t ImageLayout::min_bytes() const {
  const auto rows = static_cast<std::size_t>(height);
  constexpr std::size_t kShortestJpeg = 125;  // one black pixel
  if (format == PixelFormat::kMjpg) return kShortestJpeg;
  if (rows == 0) return 0;
  // The padding behind the last row may be missing, that behind the others may not.
  if (format == PixelFormat::kNv12) return stride * (rows + (rows + 1) / 2 - 1) + row_bytes();
  return stride * (rows - 1) + row_bytes();
}

std::optional<GreyView> grey_in_place(const ImageLayout& layout, std::span<const std::uint8_t> image) {
  if (layout.format != PixelFormat::kGrey && layout.format != PixelFormat::kNv12) return std::nullopt;
  return GreyView{image.data(), layout.stride};
}

tl::expected<void, std::string> to_grey(const ImageLayout& layout, std::span<const std::uint8_t> image,
                                        std::uint8_t* grey, std::size_t grey_stride) {
  if (layout.format == PixelFormat::kMjpg) {
    return decode_jpeg_grey(image, layout.width, layout.height, grey, grey_stride);
  }
  for (int y = 0; y < layout.height; ++y) {
    const std::uint8_t* from = image.data() + static_cast<std::size_t>(y) * layout.stride;
    std::uint8_t* to = grey + static_cast<std::size_t>(y) * grey_stride;
    switch (layout.format) {
      case PixelFormat::kGrey:
      case PixelFormat::kNv12:
        std::memcpy(to, from, static_cast<std::size_t>(layout.width));
        break;
      case PixelFormat::kYuyv:
        take_bytes<2>(from, layout.width, to);
        break;
      case PixelFormat::kUyvy:
      case PixelFormat::kY16:  // the upper byte is the second one
        take_bytes<2>(from + 1, layout.width, to);
        break;
      case PixelFormat::kZ16:
      case PixelFormat::kMjpg:
        return tl::unexpected<std::string>("holds no luminance");
    }
  }
  return {};
}

void to_depth(const ImageLayout& layout, std::span<const std::uint8_t> image, std::uint16_t* depth,
              std::size_t depth_stride) {
  auto* to = reinterpret_cast<std::uint8_t*>(depth);
  for (int y = 0; y < layout.height; ++y) {
    const auto row = static_cast<std::size_t>(y);
    std::memcpy(to + row * depth_stride, image.data() + row * layout.stride, layout.row_bytes());
  }
}

}  // namespace twofold
