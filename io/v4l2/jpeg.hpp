#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <tl/expected.hpp>

namespace twofold {

/// Luminance of one JPEG file of known size; chroma is not decoded. Frames of Motion JPEG may come without
/// Huffman tables (the standard's are used then) and with bytes behind the end marker.
///
/// Error: what is damaged, or that the size is not width x height. A file that is cut short is damaged: the
/// decoder alone would fill the rest with grey.
[[nodiscard]] tl::expected<void, std::string> decode_jpeg_grey(std::span<const std::uint8_t> file, int width,
                                                               int height, std::uint8_t* grey,
                                                               std::size_t grey_stride);

}  // namespace twofold
