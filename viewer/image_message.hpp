#pragma once

#include <cstdint>
#include <string>

#include "twofold/types.hpp"
#include "viewer/wire_format.hpp"

namespace twofold {

/// Grey or colour, of a size that makes sense.
[[nodiscard]] bool can_be_shown(const ImageView& image);

/// The image as a message of the protocol (wire_format.hpp): a JPEG, 480 pixels wide at most; nothing,
/// if it cannot be shown.
/// @param number  frame, or keyframe, as `kind` has it
[[nodiscard]] std::string image_message(ViewMessageKind kind, std::int64_t number, const ImageView& image);

}  // namespace twofold
