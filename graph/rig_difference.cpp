#include <array>
#include <cmath>
#include <cstdio>

#include "graph/map_file.hpp"

namespace twofold {
namespace {

// The same calibration, read twice or through a text file.
constexpr double kSame = 1e-6;

const char* name_of(SensorKind kind) {
  return kind == SensorKind::kStereo ? "stereo" : kind == SensorKind::kRgbd ? "RGB-D" : "a single camera";
}

}  // namespace

std::string rig_difference(const Rig& rig, const Rig& map_rig) {
  const PinholeCamera& a = rig.camera;
  const PinholeCamera& b = map_rig.camera;
  // One camera measures what the left one of a rig does.
  const bool left_only = rig.kind == SensorKind::kMono;
  if (rig.kind != map_rig.kind && !left_only) {
    return std::string("sensor is ") + name_of(rig.kind) + ", the map's is " + name_of(map_rig.kind);
  }
  if (a.width != b.width || a.height != b.height) {
    return "images are " + std::to_string(a.width) + "x" + std::to_string(a.height) + ", the map's are " +
           std::to_string(b.width) + "x" + std::to_string(b.height);
  }
  struct Pair {
    const char* name;
    double ours, theirs;
  };
  const std::array<Pair, 5> pairs{
      {{"focal length fx", a.fx, b.fx},
       {"focal length fy", a.fy, b.fy},
       {"centre cx", a.cx, b.cx},
       {"centre cy", a.cy, b.cy},
       {"baseline", left_only ? map_rig.baseline : rig.baseline, map_rig.baseline}}};
  for (const auto& [name, ours, theirs] : pairs) {
    if (std::abs(ours - theirs) <= kSame * std::max(std::abs(ours), std::abs(theirs))) continue;
    std::array<char, 96> text;
    std::snprintf(text.data(), text.size(), "%s is %.9g, the map's is %.9g", name, ours, theirs);
    return text.data();
  }
  return "";
}

}  // namespace twofold
