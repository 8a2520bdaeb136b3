#pragma once

#include <map>
#include <memory>
#include <string>

#include "io/sources/frame_source.hpp"

namespace twofold {

/// synthetic:SCENE?key=value&...  Scenes: campus, cloister, corridor, courtyard, descent, desk, landing,
/// terrace, turntable.
/// Keys, with their ranges and defaults in synthetic/options.hpp: sensor (stereo, rgbd, mono), width, height,
/// f, baseline, fps, rounds, frames, seed, noise, depth_noise, blur, shutter, readout, exposure,
/// exposure_steps, flicker, flight, object, walkers, shape, texture, plain, bare, drop, cover_at, cover,
/// carried_to, elsewhere. f follows width when only width is given. There is no ground truth while the lens
/// is covered, nor elsewhere.
///
/// Throws IoError naming the scene or key and what is wrong with it.
[[nodiscard]] std::unique_ptr<FrameSource> open_synthetic(
    const std::string& scene, const std::map<std::string, std::string>& parameters);

}  // namespace twofold
