#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "camera/rig.hpp"

namespace twofold::synthetic {

/// What to render and how the camera spoils it.
struct SyntheticOptions {
  std::string scene = "courtyard";  ///< one of scene_names()
  SensorKind sensor = SensorKind::kStereo;
  int width = 640;         ///< [px] 32 .. 4096
  int height = 480;        ///< [px] 32 .. 4096
  double f = 420;          ///< focal length [px] 10 .. 100000
  double f_error = 0;      ///< the calibration's focal length is too long by this share, -0.5 .. 0.5
  double baseline = 0.11;  ///< [m] 1e-4 .. 100; RGB-D: of the virtual right camera
  double fps = 30;         ///< [Hz] 0.01 .. 1000
  double rounds = 2;       ///< times around, or back and forth, 1e-3 .. 1e5
  int frames = 0;          ///< 0: as many as the rounds take; else the walk is cut or goes on
  std::uint64_t seed = 1;  ///< of textures and noise
  double noise = 2;        ///< standard deviation [grey levels] 0 .. 50
  double depth_noise = 1;  ///< RGB-D: factor on the sensor's depth noise, 0 .. 10
  double depth_max = 8;    ///< RGB-D: the sensor's reach [m], 0.5 .. 100
  double blur = 0;         ///< exposure time as a share of the frame interval, 0 .. 1
  double shutter = 0;      ///< readout of a rolling one [s], its rows from top to bottom, 0 .. 1 / fps
  double exposure = 0;     ///< amplitude of the changes of gain, 0 .. 0.9
  double flight = 0;       ///< the camera swings about its path (flown in camera_path.hpp) by so much, 0 .. 3
  bool object = false;     ///< something moves through the scene
  int walkers = 0;         ///< people around the camera (walkers.hpp), 0 .. 16; corridor and courtyard only
  double plain = 0;   ///< share of the walls' panels without texture, 0 .. 1; corridor and courtyard only
  bool bare = false;  ///< nothing has texture: each surface is of one grey
  int shape = 0;      ///< turntable: 0 a carton, 1 a jar with a round lid
  int texture = 0;    ///< turntable: 0 prints, 1 wood, 2 stone
  int motion = 0;     ///< turntable: 0 its plate turns, 1 the camera is carried around, 2 the thing is held
                      ///< and turned by hand
  double exposure_steps = 0;  ///< every few seconds the gain changes at once, by up to so many stops, 0 .. 4
  double flicker = 0;         ///< amplitude of the lamps' flicker, 0 .. 0.5
  double drop = 0;            ///< share of frames lost, 0 .. 0.9; the first is always there

  /// What the calibration says of `shutter` [s], 0 .. 1; nothing: it leaves that open.
  std::optional<double> readout;

  /// A hand covers the lens at this time [s], and nothing but noise is seen for `cover` seconds; 0: never.
  double cover_at = 0;
  double cover = 2;             ///< [s] 0 .. 1e6
  double carried_to = 0;        ///< the walk goes on from where it is at this time [s] >= 0
  std::uint64_t elsewhere = 0;  ///< seed of the place it goes on in, which then looks different; 0: the same

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

[[nodiscard]] const std::vector<std::string>& scene_names();

/// The usual camera of a scene; throws std::invalid_argument for an unknown scene.
[[nodiscard]] SyntheticOptions default_options(const std::string& scene);

}  // namespace twofold::synthetic
