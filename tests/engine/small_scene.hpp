#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "fixtures/rendered_scene.hpp"
#include "geometry/se3.hpp"

/// What the engine's tests look at: a stereo rig small enough to render many frames of, in a textured room.
namespace twofold::testing {

inline Rig small_rig() {
  Rig rig;
  rig.camera = {220, 220, 159.5, 119.5, 320, 240};
  rig.baseline = 0.12;
  return rig;
}

/// Gives a frame its place in a recording of 30 frames a second.
inline void number_frame(Frame& frame, int index) {
  frame.index = index;
  frame.t_ns = 1'000'000'000 + index * 33'333'333LL;
}

/// Frames [begin, end) of a walk through a room (its number is the seed of the texture), numbered from
/// `begin`.
/// @param T_c_w  pose of the left camera in frame i
template <typename Walk>
std::vector<Frame> render_walk(const Walk& T_c_w, int begin, int end, std::uint32_t room) {
  RenderedScene scene(small_rig(), Vector3(2.5, 2.0, 3.5), room);
  const SE3 T_r_c(SO3(), Vector3(-small_rig().baseline, 0, 0));
  std::vector<Frame> frames;
  for (int i = begin; i < end; ++i) {
    Frame& frame = frames.emplace_back();
    number_frame(frame, i);
    frame.left = scene.render_one(T_c_w(i), 1.5);
    frame.right = scene.render_one(T_r_c * T_c_w(i), 1.5);
  }
  return frames;
}

/// A camera that turns by 90 degrees in 45 frames.
inline SE3 turning_walk(int i) {
  const double s = 0.035 * i;
  return SE3(SO3::exp(Vector3(0.03 * std::sin(3 * s), s, 0)),
             Vector3(0.4 * std::sin(2 * s), 0.05 * std::sin(3 * s), -0.2 * s));
}

}  // namespace twofold::testing
