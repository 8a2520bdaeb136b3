#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "imaging/row_offset.hpp"

namespace twofold {

struct RightRowsOptions {
  RowOffsetOptions offset;
  int corners = 160;       ///< at which the offset is measured thoroughly, in [40, 200]
  int quick_corners = 60;  ///< likewise, at a keyframe
  /// Smaller offsets are left alone: real rigs that are well show up to 0.15, > 0.
  double significant_px = 0.35;
  int parts_of_row = 8;         ///< that the offset is rounded to, >= 1
  int looks_at_start = 30;      ///< frames, at most, until something is known, >= 1
  int look_every = 8;           ///< keyframes, >= 1
  int search_again_after = 64;  ///< keyframes: a search costs several milliseconds, >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Keeps the rows of a stereo pair together. A pair whose calibration has slipped by a row or two finds few
/// corners in both images, and those at wrong depths. The offset is measured in the first frames, and now and
/// then at a keyframe; if it is there, right images are moved back before anything else looks at them. The
/// map holds patches of left images only, so that its points stay what they were.
class RightRows {
 public:
  RightRows(const Rig& rig, const RightRowsOptions& options);

  /// The right image with the rows of the left one: itself, or a copy that is good until the next call.
  [[nodiscard]] const cv::Mat& aligned(const cv::Mat& right);
  /// Before a map is there: looks while nothing is known yet, for some frames.
  /// @param left, right  of one frame, the right one as `aligned` made it
  /// @return the offset has changed: the frame has to be aligned again
  bool look_at_start(const cv::Mat& left, const cv::Mat& right);
  /// At a keyframe. Changes nothing before two looks in a row found the rows apart.
  void look_at_keyframe(const cv::Mat& left, const cv::Mat& right);

  /// Rows that right images lie lower than left ones [px]; 0 unless that is more than measuring it can be
  /// wrong.
  [[nodiscard]] double offset() const { return offset_; }

 private:
  [[nodiscard]] bool is_apart(const std::optional<RowOffset>& rest) const;
  bool correct(const std::optional<RowOffset>& rest);

  RightRowsOptions options_;
  RowOffsetMeter thorough_, quick_;
  cv::Mat moved_;
  double offset_ = 0;
  int looks_at_start_ = 0;
  bool known_ = false;  ///< the start has seen enough
  std::int64_t keyframes_ = 0;
  int apart_ = 0;  ///< looks in a row that found the rows apart, or hardly anything
  int pause_ = 0;  ///< keyframes until the next thorough search
};

}  // namespace twofold
