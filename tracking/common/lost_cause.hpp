#pragma once

#include <cstdint>

namespace twofold {

/// Why a frame has no pose.
enum class LostCause : std::uint8_t {
  kNone,
  kNoTexture,            ///< too few corners with depth to start a map
  kImagesSwapped,        ///< likewise, but the swapped pair has them
  kRowsMisaligned,       ///< likewise, but rows further apart than can be taken back have them
  kRightCovered,         ///< likewise: the left image shows something, the right one hardly anything
  kTooFewCandidates,     ///< hardly any map point projects into the image
  kTooFewMatches,        ///< points should be visible but were not found (occlusion, wrong prediction)
  kInconsistentMatches,  ///< found points do not agree on a pose
  kNoKeyframeBuffer,     ///< the map could not be started: no free proposal
  kUnplaced,             ///< in a loaded map, of which no place was recognised yet
  kCovered,              ///< the image has hardly any contrast left: a hand, darkness, glare
  kBlurred,              ///< fine detail is gone, contrast is not
  kFramesMissing,        ///< frames before it were dropped: the camera moved on unseen
  kGapInTime,            ///< the source's time stamps jump, with no frame missing by number
  // What one camera waits for before it can start a map.
  kTooFewCorners,      ///< hardly anything could be followed
  kStepsTooWide,       ///< not even the frame before shares corners with it
  kTooLittleParallax,  ///< it has not moved enough to see depth
  kRotatingOnly,       ///< it turns on the spot
  kNoCommonMotion,     ///< corners do not move as one moving camera sees them
  kPlaneUndecided,     ///< a plane, and two motions explain how it looks
  kNoStructure         ///< a depth camera: few corners, and surfaces along which it could have slid
};
[[nodiscard]] const char* describe(LostCause cause);

}  // namespace twofold
