#pragma once

#include <vector>

#include "camera/frame.hpp"
#include "tests/imaging/rendered_scene.hpp"

namespace twofold::testing {

/// Stereo frames [0, count) of a walk through a textured room, 33 ms apart.
/// @param T_c_w  pose of the left camera in frame i
template <class Walk>
std::vector<Frame> rendered_frames(const Rig& rig, const Walk& T_c_w, int count) {
  RenderedScene scene(rig, {3, 2, 5}, 21);
  std::vector<Frame> frames;
  for (int i = 0; i < count; ++i) {
    FrameImages images;
    scene.render(T_c_w(i), 2, images);
    frames.push_back(
        {i, i * std::int64_t{33'000'000}, images.left.level(0).clone(), images.right.level(0).clone(), {}});
  }
  return frames;
}

}  // namespace twofold::testing
