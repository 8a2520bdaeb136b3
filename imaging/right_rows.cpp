#include "imaging/right_rows.hpp"

#include <algorithm>
#include <cmath>

#include "base/option_check.hpp"

namespace twofold {

std::string RightRowsOptions::invalid_reason() const {
  return OptionCheck()
      .nested("offset", offset.invalid_reason())
      .within("corners", corners, 40, 200)
      .within("quick_corners", quick_corners, 40, 200)
      .above("significant_px", significant_px, 0)
      .at_least("parts_of_row", parts_of_row, 1)
      .at_least("looks_at_start", looks_at_start, 1)
      .at_least("look_every", look_every, 1)
      .at_least("search_again_after", search_again_after, 0)
      .reason();
}

RightRows::RightRows(const Rig& rig, const RightRowsOptions& options)
    : options_(options),
      thorough_(rig, options.corners, options.offset),
      quick_(rig, options.quick_corners, options.offset),
      moved_(rig.camera.height, rig.camera.width, CV_8UC1) {}

const cv::Mat& RightRows::aligned(const cv::Mat& right) {
  if (offset_ == 0) return right;
  take_back_row_offset(right, offset_, moved_);
  return moved_;
}

bool RightRows::look_at_start(const cv::Mat& left, const cv::Mat& right) {
  if (known_) return false;
  std::optional<RowOffset> rest = thorough_.measure(left, right);
  if (is_apart(rest)) rest = thorough_.search(left, right);
  known_ = rest || ++looks_at_start_ == options_.looks_at_start;
  return correct(rest);
}

void RightRows::look_at_keyframe(const cv::Mat& left, const cv::Mat& right) {
  pause_ = std::max(pause_ - 1, 0);
  if (++keyframes_ % options_.look_every != 0) return;
  apart_ = is_apart(quick_.measure(left, right)) ? apart_ + 1 : 0;
  if (apart_ < 2 || pause_ > 0) return;
  pause_ = options_.search_again_after;
  correct(thorough_.search(left, right));
}

/// Nothing was measured, or enough is left.
bool RightRows::is_apart(const std::optional<RowOffset>& rest) const {
  return !rest || std::abs(rest->rows) > options_.significant_px;
}

/// @param rest  what is left of the offset
bool RightRows::correct(const std::optional<RowOffset>& rest) {
  if (!rest || std::abs(rest->rows) <= options_.significant_px) return false;
  const double offset = std::round(options_.parts_of_row * (offset_ + rest->rows)) / options_.parts_of_row;
  if (std::abs(offset) > RowOffsetMeter::kMost) return false;
  offset_ = offset;
  return true;
}

}  // namespace twofold
