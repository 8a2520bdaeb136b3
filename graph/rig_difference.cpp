#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "graph/map_file.hpp"

namespace twofold {
namespace {

constexpr double kSame = 1e-6;              // the same calibration, read twice or through a text file
constexpr double kSameScale = 0.03;         // of the focal lengths: patches are found at that
constexpr double kNearestDisparity = 0.25;  // of the width: what is nearer is rarely in view

const char* name_of(SensorKind kind) {
  return kind == SensorKind::kStereo ? "stereo" : kind == SensorKind::kRgbd ? "RGB-D" : "a single camera";
}

/// One camera measures what the left one of a rig does.
double baseline_in(const Rig& rig, const Rig& map_rig) {
  return rig.kind == SensorKind::kMono ? map_rig.baseline : rig.baseline;
}

/// Rigs that can have no map in common.
std::string other_sensor(const Rig& rig, const Rig& map_rig) {
  const PinholeCamera &a = rig.camera, &b = map_rig.camera;
  if (rig.kind != map_rig.kind && rig.kind != SensorKind::kMono)
    return fmt::format("sensor is {}, the map's is {}", name_of(rig.kind), name_of(map_rig.kind));
  if (a.width != b.width || a.height != b.height)
    return fmt::format("images are {}x{}, the map's are {}x{}", a.width, a.height, b.width, b.height);
  return "";
}

/// By how much at most one rig sees anything elsewhere in its images than the other [px].
double largest_shift(const Rig& rig, const Rig& map_rig) {
  const PinholeCamera &a = rig.camera, &b = map_rig.camera;
  double largest = 0;
  for (const double u : {0.0, b.width - 1.0})
    for (const double v : {0.0, b.height - 1.0}) {
      const Vector2 corner(u, v);
      largest = std::max(largest, (a.project(b.unproject(corner)) - corner).norm());
    }
  if (map_rig.kind == SensorKind::kMono || map_rig.baseline == 0) return largest;
  const double scale = a.fx * baseline_in(rig, map_rig) / (b.fx * map_rig.baseline);
  return std::max(largest, std::abs(scale - 1) * kNearestDisparity * b.width);
}

/// What another rig sees at `pixel`.
StereoPixelF seen_by(const Rig& rig, const Rig& other, const StereoPixelF& pixel) {
  const Vector2 uv = rig.camera.project(other.camera.unproject(pixel.head<2>().cast<double>()));
  const double disparity =
      pixel.x() - pixel.z();  // not a number without a right coordinate, and then neither
  const double scale = rig.camera.fx * rig.baseline / (other.camera.fx * other.baseline);
  return StereoPixel(uv.x(), uv.y(), uv.x() - scale * disparity).cast<float>();
}

/// "focal length fx is 458.9, the map's is 458.1", of all that differs; empty: nothing does.
std::string other_numbers(const Rig& rig, const Rig& map_rig) {
  struct Pair {
    const char* name;
    double ours, theirs;
  };
  const PinholeCamera &a = rig.camera, &b = map_rig.camera;
  const std::array<Pair, 5> pairs{{{"focal length fx", a.fx, b.fx},
                                   {"focal length fy", a.fy, b.fy},
                                   {"centre cx", a.cx, b.cx},
                                   {"centre cy", a.cy, b.cy},
                                   {"baseline", baseline_in(rig, map_rig), map_rig.baseline}}};
  std::string text;
  for (const auto& [name, ours, theirs] : pairs) {
    if (std::abs(ours - theirs) <= kSame * std::max(std::abs(ours), std::abs(theirs))) continue;
    text += fmt::format("{}{} is {:.9g}, the map's is {:.9g}", text.empty() ? "" : "; ", name, ours, theirs);
  }
  return text;
}

}  // namespace

std::string rig_difference(const Rig& rig, const Rig& map_rig) {
  if (std::string why = other_sensor(rig, map_rig); !why.empty()) return why;
  const std::string numbers = other_numbers(rig, map_rig);
  const double shift = largest_shift(rig, map_rig);
  if (numbers.empty() || shift <= kAcceptedShift) return "";
  return fmt::format("{}: things are seen up to {:.2g} px elsewhere, accepted is {:.2g}", numbers, shift,
                     kAcceptedShift);
}

std::string rig_note(const Rig& rig, const Rig& map_rig) {
  const std::string numbers = other_numbers(rig, map_rig);
  if (numbers.empty() || !rig_difference(rig, map_rig).empty()) return "";
  return fmt::format(
      "the map was made with another calibration: {}: things are seen up to {:.2g} px elsewhere", numbers,
      largest_shift(rig, map_rig));
}

std::string localisation_difference(const Rig& rig, const Rig& map_rig) {
  if (rig.kind != SensorKind::kMono) return rig_difference(rig, map_rig);
  const PinholeCamera &a = rig.camera, &b = map_rig.camera;
  if (std::abs(a.fx / b.fx - 1) <= kSameScale && std::abs(a.fy / b.fy - 1) <= kSameScale) return "";
  return fmt::format("focal lengths are {:.5g} and {:.5g}, the map's are {:.5g} and {:.5g}", a.fx, a.fy, b.fx,
                     b.fy);
}

KeyframeDatabase places_seen_by(const Rig& rig, const SavedMap& map) {
  KeyframeDatabase places;
  const bool with_depths = rig.kind != SensorKind::kMono;
  for (std::uint32_t k = 0; k < map.places.size(); ++k) {
    const PlaceAppearance* place = map.places.find(KeyframeId{k});
    if (place == nullptr) continue;
    PlaceAppearance seen{place->corners, {}};
    for (DescribedCorner& corner : seen.corners)
      corner.uv = rig.camera.project(map.rig.camera.unproject(corner.uv.cast<double>())).cast<float>();
    if (with_depths)
      for (const StereoPixelF& pixel : place->pixels) seen.pixels.push_back(seen_by(rig, map.rig, pixel));
    places.set(KeyframeId{k}, std::move(seen));
  }
  return places;
}

}  // namespace twofold
