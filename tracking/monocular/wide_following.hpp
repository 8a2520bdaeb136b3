#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "imaging/binary_descriptor.hpp"
#include "imaging/corner_selection.hpp"
#include "imaging/epipolar_search.hpp"
#include "imaging/guided_search.hpp"
#include "imaging/image_pyramid.hpp"
#include "tracking/monocular/corner_following.hpp"

namespace twofold {

struct WideFollowingOptions {
  double followed_share = 0.5;  ///< of a frame's corners: a step across which fewer are followed is wide, in
                                ///< [0, 1]
  int wanted = 330;             ///< corners of a candidate, of which fewer than usual are found again, >= 1
  int rounds = 2;  ///< searches along epipolar lines, each by the motion that all found so far agree on, >= 1
  CornerSelectionOptions corners{.wanted = 1000};  ///< of the current frame
  int max_distance = 64;                           ///< of a match's descriptors [bits] >= 1
  double threshold_px = 2;  ///< of matches that the motion explains: they are found to a whole pixel of their
                            ///< level, > 0
  int max_samples = 300;    ///< of RANSAC, >= 1
  int min_agreeing = 30;    ///< matches that the motion must explain, >= 5
  double nearest = 2;  ///< times the inverse depth of the nearest matches: nothing nearer is looked for, > 0
  /// Parts of the range of inverse depths, each with its own warp of the patch: what comes near grows, >= 1.
  int depth_ranges = 6;
  /// Share of what a corner differs by at other depths, that it may at the best one, in (0, 1].
  float unambiguous = 0.65F;
  GuidedSearchOptions search;
  EpipolarSearchOptions line;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Finds corners of the previous frame again across a step too wide to follow them (follow_corner): near ones
/// move by a fifth of the image, and a camera that drives towards them sees them grow. Corners of both frames
/// are matched by what they look like, wherever they are; the essential matrix that most of these matches,
/// and of the corners that could be followed, agree on says on which line each of the others is, and how its
/// patch is warped if it is so near.
///
/// Deterministic. Allocates: until there is a map, nobody depends on the tracker's time.
class WideFollowing {
 public:
  WideFollowing(const Rig& rig, const WideFollowingOptions& options);

  /// A new step: the current frame's corners are not known yet.
  void begin_step() { described_ = false; }

  /// @param corners  of the previous frame; those found get their place and motion in the current one
  /// @param seen     in step with `corners`, which were followed: those found as well are added
  void follow(const ImagePyramid& previous, const ImagePyramid& current, std::span<FollowedCorner> corners,
              std::span<char> seen);

 private:
  /// A corner of the previous frame, and where the current one sees it [level-0 pixels].
  struct Pair {
    Vector2 previous, current;
  };
  /// How the camera moved, in a unit of its own, and the greatest inverse depth in it that a corner may have.
  struct CoarseMotion {
    SE3 T_cur_prev;
    double nearest = 0;
  };

  void find_lost(const ImagePyramid& previous, const ImagePyramid& current, const CoarseMotion& motion,
                 std::span<FollowedCorner> corners, std::span<char> seen);
  void describe_current(const ImagePyramid& current);
  void match_lost(const ImagePyramid& previous, const ImagePyramid& current,
                  std::span<const FollowedCorner> corners, std::span<const char> seen);
  [[nodiscard]] std::optional<CoarseMotion> coarse_motion() const;
  [[nodiscard]] std::optional<PointMatch> most_alike(const ImagePyramid& current,
                                                     const PointAppearance& appearance,
                                                     const CoarseMotion& motion) const;
  [[nodiscard]] bool find(const ImagePyramid& previous, const ImagePyramid& current,
                          const CoarseMotion& motion, FollowedCorner& corner) const;

  Rig rig_;
  WideFollowingOptions options_;
  CornerSelector selector_;
  CornerDescriber describer_;
  bool described_ = false;
  std::vector<DescribedCorner> current_, lost_;
  std::vector<NearestDescriptor> of_lost_, of_current_;
  std::vector<Pair> pairs_;
};

}  // namespace twofold
