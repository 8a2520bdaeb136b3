#pragma once

#include <span>
#include <string>

namespace twofold {

/// Empty when the bytes of an encoded image look complete; otherwise what is wrong with them.
///
/// PNG: every chunk's length and CRC up to IEND, and the size in IHDR  (ISO/IEC 15948, 5.3 and 11.2.2).
/// JPEG: marker segments up to the first scan, the size in the frame header, and an end-of-image marker
/// (ITU-T T.81, annex B). Other kinds are left to their decoder.
[[nodiscard]] std::string image_defect(std::span<const unsigned char> bytes);

}  // namespace twofold
