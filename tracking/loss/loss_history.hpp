#pragma once

#include <cstdint>
#include <string>

#include "camera/usual_interval.hpp"
#include "imaging/image_pyramid.hpp"
#include "tracking/common/lost_cause.hpp"

namespace twofold {

/// What tells of a frame why its points were not found: shares of what the last good frame had. Two
/// neighbouring frames of a steady camera differ by a few per cent.
struct LossSignOptions {
  double covered_contrast = 0.35;  ///< with less contrast the view is covered, or dark, in (0, 1]
  /// With less detail at a fine pyramid level over that at a coarse one the image is blurred, in (0, 1].
  double blurred_detail = 0.7;
  int fine_level = 1, coarse_level = 4;  ///< 0 <= fine_level < coarse_level < ImagePyramid::kLevels
  double gap_intervals = 2.5;            ///< usual intervals between two frames: longer is a gap, > 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// What images and time stamps say about why points were not found, when that is what happened; otherwise
/// `found` again. Bounded work, no allocation.
///
/// @param gap  kFramesMissing or kGapInTime when the first lost frame came after one, else kNone
/// @param last_good  images of the last frame that had a pose; may be empty
[[nodiscard]] LostCause explain_loss(LostCause found, const ImagePyramid& now, const ImagePyramid& last_good,
                                     LostCause gap, const LossSignOptions& options);

/// Watches numbers and time stamps of frames for gaps.
class FrameIntervals {
 public:
  /// @param gap_intervals  LossSignOptions::gap_intervals
  explicit FrameIntervals(double gap_intervals) : gap_intervals_(gap_intervals) {}

  /// kNone, kFramesMissing or kGapInTime between the frame before and this one.
  LostCause next(std::int64_t index, std::int64_t t_ns);

 private:
  double gap_intervals_;
  bool any_ = false;
  std::int64_t index_ = 0;
  std::int64_t t_ns_ = 0;
  UsualInterval usual_;
};

/// Since when the camera has been lost, and after what.
class LossHistory {
 public:
  explicit LossHistory(const LossSignOptions& options) : intervals_(options.gap_intervals) {}

  /// Before a frame is tracked.
  void begin_frame(std::int64_t index, std::int64_t t_ns);
  void lost() { ++lost_frames_; }
  void placed();
  /// @return for how long there has been something in view of the lost camera [s]
  double seeing_for(bool something_in_view, std::int64_t t_ns);

  /// Frames since the last one with a pose.
  [[nodiscard]] int lost_frames() const { return lost_frames_; }
  /// Between the last good frame and the one after it: kFramesMissing, kGapInTime or kNone.
  [[nodiscard]] LostCause gap_before() const { return gap_before_; }

 private:
  FrameIntervals intervals_;
  int lost_frames_ = 0;
  LostCause gap_before_ = LostCause::kNone;
  std::int64_t seeing_since_ns_ = 0;  ///< 0: not
};

}  // namespace twofold
