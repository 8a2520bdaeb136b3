#include "imaging/right_rows.hpp"

#include <algorithm>
#include <cmath>

namespace twofold {
namespace {

constexpr int kCorners = 160;
constexpr int kQuickCorners = 60;
constexpr double kSignificant = 0.35;            // [px] real rigs that are well show up to 0.15
constexpr double kSteps = 8;                     // parts of a row that the offset is rounded to
constexpr int kLooksAtStart = 30;                // frames, at most
constexpr std::uint32_t kLookEvery = 8;          // keyframes
constexpr std::uint32_t kSearchAgainAfter = 64;  // keyframes: a search costs several milliseconds

bool is_apart(const std::optional<RowOffset>& rest) {
  return !rest || std::abs(rest->rows) > kSignificant;
}

}  // namespace

RightRows::RightRows(const Rig& rig)
    : thorough_(rig, kCorners),
      quick_(rig, kQuickCorners),
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
  known_ = rest || ++looks_at_start_ == kLooksAtStart;
  return correct(rest);
}

void RightRows::look_at_keyframe(const cv::Mat& left, const cv::Mat& right) {
  pause_ -= std::min(pause_, 1U);
  if (++keyframes_ % kLookEvery != 0) return;
  apart_ = is_apart(quick_.measure(left, right)) ? apart_ + 1 : 0;
  if (apart_ < 2 || pause_ > 0) return;
  pause_ = kSearchAgainAfter;
  correct(thorough_.search(left, right));
}

/// @param rest  what is left of the offset
bool RightRows::correct(const std::optional<RowOffset>& rest) {
  if (!rest || std::abs(rest->rows) <= kSignificant) return false;
  const double offset = std::round(kSteps * (offset_ + rest->rows)) / kSteps;
  if (std::abs(offset) > RowOffsetMeter::kMost) return false;
  offset_ = offset;
  return true;
}

}  // namespace twofold
