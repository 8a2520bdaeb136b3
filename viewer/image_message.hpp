#pragma once

#include <cstdint>
#include <string>

#include "twofold/types.hpp"

namespace twofold {

/// The image as a message of the protocol (wire_format.hpp): a JPEG, 480 pixels wide at most.
[[nodiscard]] std::string image_message(std::int64_t frame, const ImageView& image);

}  // namespace twofold
