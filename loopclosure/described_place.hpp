#pragma once

#include "camera/rig.hpp"
#include "graph/place_appearance.hpp"
#include "imaging/corner_selection.hpp"
#include "loopclosure/vocabulary.hpp"

namespace twofold {

/// A described image: how the place looks, and its words.
struct DescribedPlace : PlaceAppearance {
  BagOfWords bag;
};

/// Describes keyframes. Keeps buffers between calls; one instance a thread.
class PlaceDescriber {
 public:
  PlaceDescriber(const Rig& rig, const CornerSelectionOptions& options);

  /// Selects and describes corners; depth comes from the right image or the depth image (thesis 5.3.1 needs
  /// nearest neighbours for it, having one camera). A monocular rig leaves the pixels empty.
  [[nodiscard]] DescribedPlace describe(const FrameImages& images, const Vocabulary& vocabulary);

 private:
  Rig rig_;
  CornerSelector selector_;
  CornerDescriber describer_;
};

}  // namespace twofold
