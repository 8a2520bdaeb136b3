#pragma once

#include <optional>
#include <tl/expected.hpp>
#include <vector>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "imaging/image_pyramid.hpp"
#include "tracking/common/placement.hpp"
#include "tracking/monocular/corner_following.hpp"
#include "tracking/monocular/first_structure.hpp"
#include "tracking/monocular/wide_following.hpp"
#include "tracking/options.hpp"
#include "tracking/search/point_starter.hpp"

namespace twofold {

/// A frame since a candidate, and where it saw the candidate's corners, in step with those still seen: as a
/// global shutter would have seen them, where the calibration says how long rows take to be read.
struct PathFrame {
  std::int64_t frame_index = 0;
  std::vector<Eigen::Vector2f> places;  ///< level-0 pixels
};

/// An earlier frame whose corners are still followed: it may become the first keyframe.
struct StartCandidate {
  std::int64_t frame_index = 0;
  std::int64_t t_ns = 0;
  int age = 0;  ///< frames since
  FrameImages images;
  bool wide = false;                    ///< a step since was too wide to follow most corners across it
  std::vector<FollowedCorner> corners;  ///< those still seen
  std::size_t corners_at_first = 0;
  /// In step with `corners`: how far they moved to the frame after this one [px], which took so long [s].
  std::vector<Eigen::Vector2f> first_motion;
  double first_interval = 0;
  /// In step with `corners`: where they were at the ages stride, 2 stride, ... before the present one.
  std::vector<std::vector<Eigen::Vector2f>> between;
  int stride = 1;
  /// Likewise, of as many frames since as there is room for: they get their poses when the start is found.
  std::vector<PathFrame> path;
  int path_stride = 1;
};

/// The start as the tracker takes it over.
struct MonocularStartResult {
  const StartCandidate* first = nullptr;  ///< valid until the next step
  FirstStructure structure;               ///< of first->corners
};

/// Watches the frames of one camera until some earlier one and the newest show how it moves and how deep the
/// scene is (first_structure); in metres, if it is a depth camera (metric_scale). Several earlier frames are
/// candidates, so that neither a pause nor a turn before the start matters. Across a step too wide to follow
/// most corners a candidate takes more of them, which are found along epipolar lines (WideFollowing). Buffers
/// are made at construction; a decision allocates: until there is a map, nobody depends on the tracker's
/// time.
class MonocularStart {
 public:
  MonocularStart(const Rig& rig, const TrackerOptions& options);

  /// Forgets all candidates.
  void reset();
  /// A frame in which nothing can be started: corners are followed through it all the same, because from one
  /// frame to the next is how far they are looked for.
  void watch(const FrameImages& images, const Frame& frame);
  /// @return  the start, or what it waits for
  [[nodiscard]] tl::expected<MonocularStartResult, LostCause> step(const FrameImages& images,
                                                                   const Frame& frame);
  /// The first frame of a start and those since, as far as the points of the start say where they were seen
  /// from; to be called before the next step. Allocates.
  [[nodiscard]] std::vector<EarlierFrame> earlier_frames(const MonocularStartResult& start) const;
  /// Where the first frame saw a corner, as a global shutter would have. Likewise.
  [[nodiscard]] Vector2 first_place(const StartCandidate& first, std::size_t corner) const;
  /// How the camera moves in the frame that started (v, omega), left perturbation a second. Likewise. Nothing
  /// where the calibration gives no readout: nobody needs it then.
  [[nodiscard]] std::optional<Vector6> velocity(const MonocularStartResult& start) const;

 private:
  void follow_all(const FrameImages& images, const Frame& frame);
  bool follow_corners(const FrameImages& images, std::vector<FollowedCorner>& corners);
  void follow(const FrameImages& images, StartCandidate& candidate);
  [[nodiscard]] double readout_share(double interval) const;
  [[nodiscard]] Vector2 last_place(const FollowedCorner& corner) const;
  [[nodiscard]] std::vector<Eigen::Vector2f> last_places(const StartCandidate& candidate) const;
  void remember_place(StartCandidate& candidate) const;
  void remember_path(std::int64_t frame_index, StartCandidate& candidate) const;
  [[nodiscard]] tl::expected<FirstStructure, LostCause> examine(const StartCandidate& candidate,
                                                                const FrameImages& images) const;
  [[nodiscard]] bool to_metres(const StartCandidate& first, const FrameImages& images,
                               FirstStructure& structure) const;
  bool drop_unseen_candidates();
  void renew_candidates(const FrameImages& images, const Frame& frame);
  void remember_frame(const FrameImages& images, const Frame& frame);
  void fill(StartCandidate& candidate, const FrameImages& images, const Frame& frame);

  void choose_corners(PointStarter& starter, StartCandidate& candidate);

  Rig rig_;
  TrackerOptions options_;
  PointStarter starter_, wide_starter_;
  WideFollowing wide_following_;
  std::vector<StartCandidate> candidates_;
  std::vector<std::size_t> order_;  ///< of candidates_ in use, oldest first
  FrameImages last_;                ///< of the frame before
  bool has_last_ = false;
  std::int64_t last_index_ = 0;
  std::int64_t last_t_ns_ = 0;
  double interval_ = 0;  ///< between the last two frames [s]
  // Scratch.
  std::vector<PointAppearance> appearances_;
  std::vector<char> seen_;
};

}  // namespace twofold
