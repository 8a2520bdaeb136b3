#pragma once

#include <memory>

#include "camera/rig.hpp"
#include "graph/keyframe.hpp"
#include "graph/map_format.hpp"
#include "graph/map_point.hpp"
#include "graph/place_appearance.hpp"

namespace twofold::map_format {

/// What stands in a map file's sections, each taken on its own: numbers are finite and within their ranges;
/// whether they fit each other is MapBuilder's affair. All functions throw FormatError.

[[nodiscard]] Rig take_rig(ByteReader& in);
/// Keyframe without edges and number, which a culled one does not get.
struct KeyframeEntry {
  Keyframe keyframe;
  Heir heir;

  [[nodiscard]] bool culled() const { return heir.id != kNoKeyframe; }
};
[[nodiscard]] KeyframeEntry take_keyframe(ByteReader& in);
/// Edges of keyframe `id` to older ones, in order.
[[nodiscard]] EdgeList take_edges(ByteReader& in, KeyframeId id);
/// A culled point if it has no anchor.
[[nodiscard]] MapPoint take_point(ByteReader& in);
/// Corners are in the image; z stays empty for a monocular rig.
[[nodiscard]] PlaceAppearance take_place(ByteReader& in, const Rig& rig);

}  // namespace twofold::map_format
