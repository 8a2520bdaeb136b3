#pragma once

#include <filesystem>

#include "io/sources/frame_source.hpp"

namespace twofold {

/// The surfaces of a rendered source as a mesh, in the frame of its ground truth. Throws IoError, also when
/// the source has none.
void write_true_surface(const std::filesystem::path& file, const FrameSource& source);

/// The same, cut into triangles of a centimetre, of which those are kept that a depth image shows or, of a
/// pair, both cameras at once: every so many-th frame is asked. Reads the source to its end. Throws IoError,
/// also when it is one camera's.
void write_seen_surface(const std::filesystem::path& file, FrameSource& source, int every);

}  // namespace twofold
