#include "tracking/common/lost_cause.hpp"

namespace twofold {

const char* describe(LostCause cause) {
  switch (cause) {
    case LostCause::kNone:
      return "";
    case LostCause::kNoTexture:
      return "too few corners with depth to start a map";
    case LostCause::kImagesSwapped:
      return "too few corners with depth: left and right image are swapped";
    case LostCause::kRowsMisaligned:
      return "too few corners with depth: rows of the right image lie higher or lower than the left's; "
             "rectify the pair";
    case LostCause::kRightCovered:
      return "too few corners with depth: the right camera sees hardly anything; is it covered, or dark?";
    case LostCause::kTooFewCandidates:
      return "hardly any map point should be visible";
    case LostCause::kTooFewMatches:
      return "visible map points were not found";
    case LostCause::kInconsistentMatches:
      return "found points do not agree on a pose";
    case LostCause::kNoKeyframeBuffer:
      return "no free buffer to start the map with";
    case LostCause::kUnplaced:
      return "no place of the loaded map was recognised yet";
    case LostCause::kCovered:
      return "the lens is covered, or it is dark: no contrast";
    case LostCause::kBlurred:
      return "the image is blurred";
    case LostCause::kFramesMissing:
      return "frames before it were dropped, and the camera moved on";
    case LostCause::kGapInTime:
      return "a gap in the time stamps, and the camera moved on";
    case LostCause::kTooFewCorners:
      return "too few corners to start a map";
    case LostCause::kStepsTooWide:
      return "corners were not found again from one frame to the next: frames are too far apart, or blurred";
    case LostCause::kTooLittleParallax:
      return "too little parallax to start a map";
    case LostCause::kRotatingOnly:
      return "rotating only: no depth to start a map with";
    case LostCause::kNoCommonMotion:
      return "corners do not move as one moving camera sees them";
    case LostCause::kPlaneUndecided:
      return "a plane: two motions explain how it looks";
    case LostCause::kNoStructure:
      return "no structure: few corners, and the surfaces in view leave open how the camera moved along them";
  }
  return "";
}

}  // namespace twofold
