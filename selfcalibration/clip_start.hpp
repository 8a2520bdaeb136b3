#pragma once

#include "selfcalibration/clip_adjustment.hpp"

namespace twofold {

/// Motion of a clip with a lens that is known or supposed, to begin an adjustment with: rotations alone, all
/// corners at one depth. Right for small and turning motions.
[[nodiscard]] ClipMotion start_by_rotation(const Clip& clip, const SharedLens& lens);

/// Likewise, from the essential matrix of first and last view.
[[nodiscard]] ClipMotion start_by_essential_matrix(const Clip& clip, const SharedLens& lens);

}  // namespace twofold
