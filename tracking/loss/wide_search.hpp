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
  int max_distance = 64;  ///< of a match's descriptors [bits] >= 1
  int min_agreeing = 8;   ///< matches that the motion must explain, >= 3
  /// Corners are found to a whole pixel of their level only.
  PoseConsensusOptions consensus{.inlier_sigmas = 8, .max_samples = 2000};
  // One camera.
  int min_turned = 20;  ///< matches that the rotation must explain, >= 2 ...
  /// ... by how far from where it takes them, of the image's width: the camera moves as well, > 0.
  double turned_within = 0.02;
  int max_turns = 500;  ///< samples, >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// The corners of a frame, and of those that somebody asked for, where the right camera sees them.
struct FrameCorners {
  bool described = false;  ///< else they were not looked for yet
  std::vector<DescribedCorner> corners;
  std::vector<std::optional<double>> right;  ///< of each corner, NaN where there is none [px]

  void clear() {
    described = false;
    corners.clear();
    right.clear();
  }
};

/// Finds the camera again after a step that was too wide for the guided search: corners of an earlier frame
/// are matched with those of this one by what they look like, wherever they are; matches with depth in both
/// frames give the motion that most of them agree on (three-point RANSAC). That is a proposal: only a guided
/// search of the map's points from there tells whether it is right. One camera has no depth in either frame:
/// it gets the rotation that most matches agree on, which takes points far away to where they are seen.
///
/// To describe a frame takes longer than to compare it: what was described is kept.
///
/// Work is bounded by corners and samples. No allocation after construction.
class WideSearch {
 public:
  WideSearch(const Rig& rig, const WideSearchOptions& options);

  /// Makes room for the corners of a frame.
  void prepare(FrameCorners& corners) const;

  /// The frame whose pose is sought: its images must stay until the last `find`.
  void look_at(const FrameImages& images);
  /// That frame's.
  [[nodiscard]] const FrameCorners& corners() const { return corners_; }

  /// Finds the corners of a frame, unless they are known. Made by `prepare`.
  void describe(const FrameImages& images, FrameCorners& corners);

  /// @param corners  of the earlier frame; found if they are not known. Made by `prepare`.
  /// @param search   the same for all searches
  /// @return T_now_earlier, without a translation with one camera; nothing when too few matches agree on one
  [[nodiscard]] std::optional<SE3> find(const FrameImages& earlier, FrameCorners& corners,
                                        const GuidedSearchOptions& search);

 private:
  /// visit(position in `corners`, position in corners_) for those that look alike, each more than any other.
  template <class Visit>
  void for_alike(const FrameCorners& corners, Visit&& visit);
  [[nodiscard]] std::optional<SO3> find_rotation(const FrameCorners& corners);
  void match(const FrameImages& earlier, FrameCorners& corners, const GuidedSearchOptions& search);
  [[nodiscard]] Vector3 measure(const FrameImages& images, FrameCorners& corners, std::size_t i,
                                const GuidedSearchOptions& search) const;

  Rig rig_;
  WideSearchOptions options_;
  const FrameImages* now_ = nullptr;
  CornerSelector selector_;
  CornerDescriber describer_;
  FrameCorners corners_;                                    ///< of the frame whose pose is sought
  std::vector<NearestDescriptor> of_earlier_, of_corners_;  ///< in the other frame each
  std::vector<MotionObservation> matches_;
  std::vector<Vector3> bearings_earlier_, bearings_now_;  ///< one camera's matches
  std::vector<SO3> rotations_;                            ///< scratch
  PoseConsensus consensus_;
};

}  // namespace twofold
