#include "synthetic/options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/angles.hpp"
#include "synthetic/scenes.hpp"

namespace twofold::synthetic {

std::string SyntheticOptions::invalid_reason() const {
  const auto outside = [](const char* name, double value, double low, double high) -> std::string {
    if (value >= low && value <= high) return {};
    return fmt::format("{} must be between {} and {}, not {}", name, low, high, value);
  };
  const std::string reasons[] = {outside("width", width, 32, 4096),
                                 outside("height", height, 32, 4096),
                                 outside("f", f, 10, 100000),
                                 outside("f_error", f_error, -0.5, 0.5),
                                 outside("baseline", baseline, 1e-4, 100),
                                 outside("fps", fps, 0.01, 1000),
                                 outside("rounds", rounds, 1e-3, 1e5),
                                 outside("frames", frames, 0, 1e8),
                                 outside("noise", noise, 0, 50),
                                 outside("depth_noise", depth_noise, 0, 10),
                                 outside("depth_max", depth_max, 0.5, 100),
                                 outside("blur", blur, 0, 1),
                                 outside("shutter", shutter, 0, 1 / fps),
                                 outside("readout", readout.value_or(0), 0, 1),
                                 outside("exposure", exposure, 0, 0.9),
                                 outside("flight", flight, 0, 3),
                                 outside("walkers", walkers, 0, 16),
                                 outside("plain", plain, 0, 1),
                                 outside("shape", shape, 0, kTurntableShapes - 1),
                                 outside("texture", texture, 0, kTurntableTextures - 1),
                                 outside("motion", motion, 0, kTurntableMotions - 1),
                                 outside("exposure_steps", exposure_steps, 0, 4),
                                 outside("flicker", flicker, 0, 0.5),
                                 outside("drop", drop, 0, 0.9),
                                 outside("cover_at", cover_at, 0, 1e6),
                                 outside("cover", cover, 0, 1e6),
                                 outside("carried_to", carried_to, 0, 1e6)};
  for (const std::string& reason : reasons)
    if (!reason.empty()) return reason;
  const bool has_walls = scene == "corridor" || scene == "courtyard";
  if (walkers > 0 && !has_walls)
    return fmt::format("walkers need ground to walk on, which {} has not", scene);
  if (plain > 0 && !has_walls) return fmt::format("plain panels need walls, which {} has not", scene);
  if ((shape > 0 || texture > 0 || motion > 0) && scene != "turntable")
    return fmt::format("shape, texture and motion are the turntable's, not of {}", scene);
  return {};
}

const std::vector<std::string>& scene_names() {
  static const std::vector<std::string> kNames{"campus", "cloister", "corridor", "courtyard", "descent",
                                               "desk",   "landing",  "terrace",  "turntable"};
  return kNames;
}

SyntheticOptions default_options(const std::string& scene) {
  const auto& names = scene_names();
  if (std::find(names.begin(), names.end(), scene) == names.end())
    throw std::invalid_argument(fmt::format("unknown scene '{}' (known: {})", scene, fmt::join(names, ", ")));
  SyntheticOptions options;
  options.scene = scene;
  if (scene == "descent") {  // SWF 4.2: 25 degrees across, 15 cm a frame
    options.width = 1024;
    options.height = 768;
    options.f = 0.5 * 1024 / std::tan(12.5 * kDegree);
    options.baseline = 0.1;
    options.fps = 10;
    options.rounds = 1;
  }
  if (scene == "cloister" || scene == "campus") {  // 80 degrees across
    options.width = 320;
    options.height = 240;
    options.f = 0.5 * 320 / std::tan(40 * kDegree);
    options.fps = 15;
    options.rounds = scene == "cloister" ? 1.3 : 1;
  }
  if (scene == "terrace") {  // by car: 80 degrees across, half a metre a frame
    options.width = 640;
    options.height = 240;
    options.f = 0.5 * 640 / std::tan(40 * kDegree);
    options.baseline = 0.5;
    options.fps = 15;
    options.rounds = 1;
  }
  if (scene == "landing") {  // 75 degrees across; nothing is near enough for a second camera
    options.sensor = SensorKind::kMono;
    options.width = 320;
    options.height = 240;
    options.f = 210;
    options.rounds = 1;
  }
  if (scene == "turntable") {
    options.f = 700;
    options.baseline = 0.06;
  }
  if (scene == "cloister") options.f_error = -0.1;
  return options;
}

}  // namespace twofold::synthetic
