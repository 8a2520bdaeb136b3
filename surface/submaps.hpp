#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "graph/snapshot.hpp"
#include "surface/composition.hpp"
#include "surface/depth_view.hpp"
#include "surface/free_space/free_space.hpp"
#include "surface/packed_images.hpp"
#include "surface/volume.hpp"

namespace twofold {

struct SubmapOptions {
  int max_keyframes = 10;        ///< of a submap >= 1
  std::size_t max_waiting = 64;  ///< depth images that wait for their keyframes or to be fused, and keyframes
                                 ///< that wait for their depth >= 1
  /// Of samples and depth images [MiB] > 0: with more than this no keyframe is added, and its depth is let go
  /// of. What is fused anew may exceed it.
  double memory_mb = 2000;
  std::uint32_t first_keyframe = 0;  ///< those before are of another run's frames: a loaded map's
  bool free_space = false;           ///< also keep what images saw through, away from surfaces
  double max_free_depth = 0;         ///< FreeSpace's reach [m] >= 0; 0: as far as there are readings

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// How many keyframes a step fuses at most, of those that wait.
struct SubmapWork {
  std::size_t keyframes = std::numeric_limits<std::size_t>::max();  ///< new ones
  std::size_t anew = std::numeric_limits<std::size_t>::max();       ///< of bent submaps, fused anew
};

/// What a frame that is to become a keyframe gives to the surface.
struct KeyframeDepth {
  std::int64_t frame_index = 0;
  PackedDepth depth;
  PackedColour colour;  ///< may be empty
};

/// A submap at its place, which nobody changes any more.
struct SharedSubmap {
  KeyframeId part{0};  ///< the map part whose world T_w_s is of
  std::shared_ptr<const SurfaceVolume> volume;
  std::shared_ptr<const FreeSpace> free;  ///< null unless SubmapOptions::free_space
  SE3 T_w_s;
};

/// The images that were packed.
struct DepthImages {
  cv::Mat depth, colour;
};

/// Packs the images of a frame, which must have no depth_defect. depth: CV_16UC1.
[[nodiscard]] KeyframeDepth pack_keyframe_depth(std::int64_t frame_index, const cv::Mat& depth,
                                                const cv::Mat& colour);

struct SubmapReport {
  int fused = 0;               ///< depth images, each time
  int fused_anew = 0;          ///< of these, because their submap's poses had changed
  std::int64_t fusion_ns = 0;  ///< processor time of all, unpacking included
  int without_readings = 0;    ///< keyframes whose depth image is all holes: not among these
  int not_in_map = 0;          ///< frames without a keyframe: never in the map, culled, or too far back
  int culled = 0;              ///< keyframes whose depth was let go of when the map culled them
  int submaps_dropped = 0;     ///< when all their keyframes were culled
  int beyond_memory = 0;       ///< keyframes that were not fused for want of memory
  int overtaken = 0;           ///< frames that were let go of unseen, because too many waited
  std::size_t most_bytes = 0;  ///< of samples and depth images at one time
};

/// The surface of a growing map, in submaps that hang on groups of keyframes  (after Reijgwart et al.,
/// Voxgraph, RA-L 2020).
///
/// Each keyframe's depth is fused into the submap that it shares most points with, or begins one. A submap
/// stands still relative to one of its keyframes: a loop moves it as a whole. It begins on the world's grid
/// of samples, so that nothing is resampled in a Composition while it has moved by no more than may rest.
/// When poses inside a group moved against each other by more than half a voxel, at the depth that is seen,
/// the submap is bent, and fused anew. Culled keyframes give up their depth, and what they had added remains
/// until then; a submap that has none left goes. So memory follows the place. Same calls, same bytes; one
/// thread at a time.
class SubmapSurface {
 public:
  /// Options must be valid.
  SubmapSurface(const Rig& rig, const SurfaceOptions& options, const SubmapOptions& submaps);

  /// A frame that is proposed as a keyframe, before or after a map has it; frame_index grows, and is not
  /// compared with that of keyframes before SubmapOptions::first_keyframe.
  /// @param images  may be empty. Those of the newest frames are kept until they are fused, and need not be
  ///                unpacked
  void offer(KeyframeDepth frame, DepthImages images = {});
  /// Takes the map as it is now. Versions do not shrink. Submaps move with their keyframes in any case, which
  /// takes no time; what `work` leaves waits for later steps, of bent submaps those that are bent least. A
  /// submap stays as it was until all its keyframes are fused anew.
  void step(const GraphSnapshot& graph, const SubmapWork& work = {});
  /// Submaps that are bent and wait to be fused anew.
  [[nodiscard]] std::size_t bent() const { return bent_; }
  /// Of the last step's map, the first keyframe whose depth may still be fused, or come: all before are done
  /// with. The number of keyframes, if there is none.
  [[nodiscard]] std::size_t first_unfused() const {
    return without_depth_.empty() ? next_keyframe_ : index(without_depth_.front());
  }
  /// Whether the last step could have fused more new keyframes.
  [[nodiscard]] bool keyframes_left() const { return keyframes_left_; }
  /// Whether the last step left anything to do in the map it had.
  [[nodiscard]] bool unfinished() const { return bent() > 0 || keyframes_left(); }

  /// All submaps of a map part in its world frame, as it was in the last step, added into one.
  [[nodiscard]] SurfaceVolume whole(KeyframeId part) const;
  /// These submaps, as Composition takes them; valid until the next step.
  [[nodiscard]] std::vector<PlacedVolume> placed(KeyframeId part) const;

  /// The submaps of all map parts for whoever asks about them later, on any thread: takes no time, and each
  /// is copied before it changes.
  [[nodiscard]] std::vector<SharedSubmap> share();

  [[nodiscard]] const SubmapReport& report() const { return report_; }
  [[nodiscard]] std::size_t submap_count() const { return submaps_.size(); }
  [[nodiscard]] std::size_t waiting() const { return waiting_.size(); }
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct Member {
    KeyframeId id = kNoKeyframe;
    KeyframeDepth packed;
    double reach = 1;               ///< depth that is seen [m]
    SE3 T_k_w;                      ///< in the last step
    SE3 T_k_s;                      ///< along which it was fused
    std::optional<SE3> T_k_s_anew;  ///< the same in Submap::anew
  };
  struct Submap {
    std::uint32_t id = 0;
    KeyframeId hung_on = kNoKeyframe;  ///< one of its members
    SE3 T_k_s;                         ///< of that keyframe: constant
    SE3 T_w_s;                         ///< in the last step
    KeyframeId part{0};
    std::vector<Member> members;
    /// Samples and free space; copied before they change if somebody else may have them.
    struct Content {
      Content(const SurfaceOptions& options, const SubmapOptions& submaps);
      [[nodiscard]] SurfaceVolume& volume_to_change();
      [[nodiscard]] FreeSpace& free_to_change();
      [[nodiscard]] std::size_t bytes() const;
      /// Takes the place of what was fused along other poses.
      void replace(const Content& before);

      std::shared_ptr<SurfaceVolume> volume;
      std::shared_ptr<FreeSpace> free;  ///< null unless SubmapOptions::free_space
      bool volume_shared = false, free_shared = false;
    };
    Content content;
    std::optional<Content> anew;  ///< what is to take its place, as far as keyframes are fused anew
  };

  void let_go_of_culled(const GraphSnapshot& graph);
  void move_submaps(const GraphSnapshot& graph);
  void take_new_keyframes(const GraphSnapshot& graph, std::size_t most);
  struct Waiting {
    KeyframeDepth packed;
    DepthImages images;  ///< of the newest only
  };
  void add_keyframe(const GraphSnapshot& graph, const Keyframe& keyframe, Waiting frame);
  [[nodiscard]] Submap& submap_for(const GraphSnapshot& graph, const Keyframe& keyframe);
  void fuse_bent(std::size_t most);
  /// @return  keyframes fused
  std::size_t fuse_anew(Submap& submap, std::size_t most);
  [[nodiscard]] double bend_of(const Submap& submap) const;
  [[nodiscard]] std::size_t bytes_anew() const;
  /// False for an image without readings, of which nothing becomes.
  /// @param images  empty: those that the member has packed
  bool fuse(Submap::Content& into, const Member& member, const SE3& T_k_s, DepthImages images);
  /// What the image that was fused last hides is not known to be free any more in any other submap.
  void forget_hidden(const Submap& fused_into, const SE3& T_k_w);

  Rig rig_;
  SurfaceOptions options_;
  SubmapOptions limits_;
  std::deque<Waiting> waiting_;           ///< ascending by frame
  std::uint32_t next_keyframe_;           ///< the first that no step has seen
  std::deque<KeyframeId> without_depth_;  ///< the newest of those seen, whose depth may still come; ascending
  std::vector<std::unique_ptr<Submap>> submaps_;  ///< ascending by id
  std::uint32_t next_submap_ = 0;
  std::size_t bent_ = 0;         ///< after the last step
  bool keyframes_left_ = false;  ///< likewise
  DepthView view_;               ///< its memory is taken again
  SubmapReport report_;
};

}  // namespace twofold
