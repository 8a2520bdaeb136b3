#pragma once

#include <memory>

#include "camera/rig.hpp"
#include "graph/keyframe.hpp"
#include "graph/map_format.hpp"
#include "graph/map_point.hpp"
#include "graph/place_appearance.hpp"

namespace twofold::map_format {

/// What stands in a map file's sections, each taken on its own: numbers are finite and within their ranges;
/// whether they fit each other is MapBuilder's affair. All functions throw MalformedBytes.

[[nodiscard]] Rig take_rig(EntryReader& in);
/// A keyframe, or the replacement of one that was culled if that is known.
struct KeyframeEntry {
  KeyframeId id = kNoKeyframe;
  Keyframe keyframe;  ///< without edges; a culled one has no number
  EdgeList edges;     ///< to older keyframes, in order
  Replacement replacement;

  [[nodiscard]] bool culled() const { return keyframe.culled(); }
  [[nodiscard]] bool forgotten() const { return culled() && replacement.id == kNoKeyframe; }
};
[[nodiscard]] KeyframeEntry take_keyframe(EntryReader& in, KeyframeId id);
/// The same in format version 1.
[[nodiscard]] KeyframeEntry take_keyframe_1(EntryReader& in, KeyframeId id);
/// A culled point, of which nothing follows, if it has no anchor.
[[nodiscard]] MapPoint take_point(EntryReader& in);
/// Corners are in the image; their pixels stay empty for a monocular rig.
[[nodiscard]] PlaceAppearance take_place(EntryReader& in, const Rig& rig);

}  // namespace twofold::map_format
