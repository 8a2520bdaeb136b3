#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "estimation/motion_only.hpp"
#include "estimation/pose_consensus.hpp"
#include "imaging/binary_descriptor.hpp"
#include "imaging/corner_selection.hpp"
#include "imaging/guided_search.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {

struct WideSearchOptions {
  bool enabled = true;  ///< else a frame after a step too wide for the prediction is lost
  CornerSelectionOptions corners{.wanted = 700};
  int max_distance = 64;  ///< of a match's descriptors [bits]
  int min_agreeing = 8;   ///< matches that the motion must explain
  /// Corners are found to a whole pixel of their level only.
  PoseConsensusOptions consensus{.inlier_sigmas = 8, .max_samples = 2000};

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Finds the camera again after a step that was too wide for the guided search: corners of an earlier frame
/// are matched with those of this one by what they look like, wherever they are; matches with depth in both
/// frames give the motion that most of them agree on (three-point RANSAC). That is a proposal: only a guided
/// search of the map's points from there tells whether it is right.
///
/// Work is bounded by corners and samples. No allocation after construction.
class WideSearch {
 public:
  WideSearch(const Rig& rig, const WideSearchOptions& options);

  /// Makes room for the corners of a frame.
  void prepare(std::vector<DescribedCorner>& corners) const;

  /// The frame whose pose is sought: its images must stay until the last `find`.
  void look_at(const FrameImages& images);

  /// @param corners  of the earlier frame; filled if empty. Made by `prepare`.
  /// @return T_now_earlier; nothing when too few matches agree on one
  [[nodiscard]] std::optional<SE3> find(const FrameImages& earlier, std::vector<DescribedCorner>& corners,
                                        const GuidedSearchOptions& search);

 private:
  void describe(const FrameImages& images, std::vector<DescribedCorner>& corners);
  void match(const FrameImages& earlier, std::span<const DescribedCorner> corners,
             const GuidedSearchOptions& search);

  Rig rig_;
  WideSearchOptions options_;
  const FrameImages* now_ = nullptr;
  CornerSelector selector_;
  CornerDescriber describer_;
  std::vector<DescribedCorner> corners_;                    ///< of the frame whose pose is sought
  std::vector<NearestDescriptor> of_earlier_, of_corners_;  ///< in the other frame each
  std::vector<MotionObservation> matches_;
  PoseConsensus consensus_;
};

}  // namespace twofold
