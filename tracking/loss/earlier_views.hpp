#pragma once

#include <optional>

#include "camera/rig.hpp"
#include "imaging/guided_search.hpp"
#include "tracking/common/placement.hpp"
#include "tracking/loss/recent_views.hpp"
#include "tracking/loss/wide_search.hpp"

namespace twofold {

/// What a lost camera is compared with, and what depth alignment aligns to: what the newest keyframes saw,
/// and the lost frame that the loop closer was asked about. A likeness only proposes a pose (WideSearch); the
/// map's points decide.
///
/// No allocation after construction.
class EarlierViews {
 public:
  /// @param guided     the search around a view's points, once the camera was turned
  /// @param keyframes  so many of the newest are compared with
  EarlierViews(const Rig& rig, const WideSearchOptions& wide, const GuidedSearchOptions& guided,
               int keyframes);

  /// A new frame: its corners are not known yet.
  void begin_frame() { looked_ = false; }
  /// Finds the frame's corners, once. Its images must stay until the last `find`.
  void look_at(const FrameImages& now);
  /// Pose of the frame looked at relative to an earlier one.
  /// @param corners  of the earlier frame; found if they are not known. Made by `prepare`.
  [[nodiscard]] std::optional<SE3> find(const FrameImages& earlier, FrameCorners& corners);
  /// False where the wide search is off.
  [[nodiscard]] bool can_find() const { return can_find_; }

  /// Makes room for a frame's corners.
  void prepare(FrameCorners& corners) const { search_.prepare(corners); }
  /// Those of this frame, if it was looked at; else none.
  void copy_corners(FrameCorners& corners) const;

  /// The frame became a keyframe.
  void add_keyframe(KeyframeId id, const FrameImages& images);
  [[nodiscard]] RecentViews& keyframes() { return keyframes_; }

  /// Keeps this lost frame until the next call, because the camera moves on before the answer comes.
  /// @return the images kept
  const FrameImages& ask(const FrameImages& now);
  void answer(const Placement& placement) { answer_ = placement; }
  /// The answer, once.
  [[nodiscard]] std::optional<Placement> take_answer();
  /// The frame kept.
  [[nodiscard]] RecentView& asked() { return asked_; }

 private:
  bool can_find_;
  GuidedSearchOptions guided_;
  WideSearch search_;
  bool looked_ = false;
  RecentViews keyframes_;
  RecentView asked_;
  std::optional<Placement> answer_;
};

}  // namespace twofold
