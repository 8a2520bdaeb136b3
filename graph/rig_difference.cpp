#include <array>
#include <cmath>
#include <cstdio>

#include "graph/map_file.hpp"

namespace twofold {
namespace {

// The same calibration, read twice or through a text file.
constexpr double kSame = 1e-6;
constexpr double kSameScale = 0.03;  // of the focal lengths: patches are found at that

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

std::string localisation_difference(const Rig& rig, const Rig& map_rig) {
  if (rig.kind != SensorKind::kMono) return rig_difference(rig, map_rig);
  const PinholeCamera &a = rig.camera, &b = map_rig.camera;
  if (std::abs(a.fx / b.fx - 1) <= kSameScale && std::abs(a.fy / b.fy - 1) <= kSameScale) return "";
  std::array<char, 128> text;
  std::snprintf(text.data(), text.size(), "focal lengths are %.5g and %.5g, the map's are %.5g and %.5g",
                a.fx, a.fy, b.fx, b.fy);
  return text.data();
}

KeyframeDatabase places_seen_by(const PinholeCamera& camera, const SavedMap& map) {
  KeyframeDatabase places;
  for (std::uint32_t k = 0; k < map.places.size(); ++k) {
    const PlaceAppearance* place = map.places.find(KeyframeId{k});
    if (place == nullptr) continue;
    PlaceAppearance seen{place->corners, {}};
    for (DescribedCorner& corner : seen.corners)
      corner.uv = camera.project(map.rig.camera.unproject(corner.uv.cast<double>())).cast<float>();
    places.set(KeyframeId{k}, std::move(seen));
  }
  return places;
}

}  // namespace twofold
