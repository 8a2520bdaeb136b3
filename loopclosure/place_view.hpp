#pragma once

#include <vector>

#include "camera/rig.hpp"
#include "loopclosure/corner_selection.hpp"
#include "loopclosure/vocabulary.hpp"

namespace twofold {

/// What the loop closer keeps of a keyframe: how its place looks, and where its corners are.
struct PlaceView {
  std::vector<DescribedCorner> corners;
  /// In step with corners: (u_l, v_l, u_r) level-0 pixels; u_r is Rig::kNoRight where no depth is known.
  std::vector<Eigen::Vector3f> z;
  BagOfWords bag;
};

/// Describes keyframes. Keeps buffers between calls; one instance a thread.
class PlaceDescriber {
 public:
  PlaceDescriber(const Rig& rig, const CornerSelectionOptions& options);

  /// Selects and describes corners; depth comes from the right image or the depth image (thesis 5.3.1 needs
  /// nearest neighbours for it, having one camera). A monocular rig leaves z empty.
  [[nodiscard]] PlaceView describe(const FrameImages& images, const Vocabulary& vocabulary);

 private:
  Rig rig_;
  CornerSelector selector_;
  CornerDescriber describer_;
};

}  // namespace twofold
