#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <tl/expected.hpp>

namespace twofold {

/// What a camera may deliver that becomes a grey (or depth) image here.
enum class PixelFormat : std::uint8_t {
  kGrey,  ///< 8 bits of luminance
  kNv12,  ///< a plane of luminance, then one of colour at half size
  kYuyv,  ///< Y0 U Y1 V
  kUyvy,  ///< U Y0 V Y1
  kY16,   ///< 16 bits of luminance, little endian
  kZ16,   ///< 16 bits of depth, little endian
  kMjpg,  ///< a JPEG file a frame
};

/// In the order of preference: the cheaper to turn into grey, the earlier.
[[nodiscard]] std::span<const PixelFormat> pixel_formats();
[[nodiscard]] std::uint32_t fourcc(PixelFormat format);
[[nodiscard]] const char* name(PixelFormat format);  ///< "YUYV", ...
[[nodiscard]] std::optional<PixelFormat> pixel_format_from_fourcc(std::uint32_t fourcc);
[[nodiscard]] std::optional<PixelFormat> pixel_format_from_name(const std::string& name);
/// Four letters; what cannot be printed becomes '?'.
[[nodiscard]] std::string fourcc_text(std::uint32_t fourcc);

/// How an image lies in memory.
struct ImageLayout {
  PixelFormat format = PixelFormat::kGrey;
  int width = 0;
  int height = 0;
  std::size_t stride = 0;  ///< bytes from row to row of the first plane; without meaning for kMjpg

  /// Bytes of one row's pixels; 0 for kMjpg.
  [[nodiscard]] std::size_t row_bytes() const;
  /// Least number of bytes that hold a whole image; for kMjpg the shortest thinkable file.
  [[nodiscard]] std::size_t min_bytes() const;
};

/// Luminance that is in the image already and need not be copied (kGrey, kNv12).
struct GreyView {
  const std::uint8_t* data = nullptr;
  std::size_t stride = 0;
};
[[nodiscard]] std::optional<GreyView> grey_in_place(const ImageLayout& layout,
                                                    std::span<const std::uint8_t> image);

/// Writes the luminance, height rows of width bytes. Any format but kZ16. image.size() >= layout.min_bytes().
/// Error: how a JPEG is damaged or that its size is another one; `grey` is then unspecified. 16 bits lose the
/// lower 8.
[[nodiscard]] tl::expected<void, std::string> to_grey(const ImageLayout& layout,
                                                      std::span<const std::uint8_t> image, std::uint8_t* grey,
                                                      std::size_t grey_stride);

/// Copies 16 bits a pixel (kZ16, kY16) row by row; depth_stride in bytes.
void to_depth(const ImageLayout& layout, std::span<const std::uint8_t> image, std::uint16_t* depth,
              std::size_t depth_stride);

}  // namespace twofold
