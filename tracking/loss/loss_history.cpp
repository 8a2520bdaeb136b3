#include "tracking/loss/loss_history.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "base/option_check.hpp"

namespace twofold {
namespace {

/// Mean absolute difference of horizontal neighbours [grey].
double detail(const cv::Mat& image) {
  std::int64_t sum = 0;
  for (int v = 0; v < image.rows; ++v) {
    const auto* row = image.ptr<std::uint8_t>(v);
    int in_row = 0;
    for (int u = 1; u < image.cols; ++u) in_row += std::abs(int{row[u]} - int{row[u - 1]});
    sum += in_row;
  }
  return static_cast<double>(sum) / std::max<double>(1, static_cast<double>(image.total()));
}

/// Standard deviation [grey].
double contrast(const cv::Mat& image) {
  double sum = 0, squares = 0;
  for (int v = 0; v < image.rows; ++v) {
    const auto* row = image.ptr<std::uint8_t>(v);
    for (int u = 0; u < image.cols; ++u) {
      sum += row[u];
      squares += double{1} * row[u] * row[u];
    }
  }
  const double n = std::max<double>(1, static_cast<double>(image.total()));
  return std::sqrt(std::max(0.0, squares / n - sum / n * (sum / n)));
}

/// Detail at a fine level over that at a coarse one: blur takes the first away and leaves the second; a view
/// of something else changes both.
double sharpness(const ImagePyramid& images, const LossSignOptions& options) {
  return detail(images.level(options.fine_level)) / (1 + detail(images.level(options.coarse_level)));
}

}  // namespace

std::string LossSignOptions::invalid_reason() const {
  return OptionCheck()
      .within("fine_level", fine_level, 0, ImagePyramid::kLevels - 2)
      .within("coarse_level", coarse_level, fine_level + 1, ImagePyramid::kLevels - 1)
      .share("covered_contrast", covered_contrast)
      .share("blurred_detail", blurred_detail)
      .above("gap_intervals", gap_intervals, 1)
      .reason();
}

LostCause explain_loss(LostCause found, const ImagePyramid& now, const ImagePyramid& last_good, LostCause gap,
                       const LossSignOptions& options) {
  const bool unexplained = found == LostCause::kTooFewMatches || found == LostCause::kInconsistentMatches ||
                           found == LostCause::kTooFewCandidates;
  if (!unexplained) return found;
  if (!last_good.empty()) {
    if (contrast(now.level(options.coarse_level)) <
        options.covered_contrast * contrast(last_good.level(options.coarse_level)))
      return LostCause::kCovered;
    if (sharpness(now, options) < options.blurred_detail * sharpness(last_good, options))
      return LostCause::kBlurred;
  }
  return gap != LostCause::kNone ? gap : found;
}

LostCause FrameIntervals::next(std::int64_t index, std::int64_t t_ns) {
  LostCause gap = LostCause::kNone;
  if (any_) {
    const std::int64_t interval = t_ns - t_ns_;
    if (index > index_ + 1) {
      gap = LostCause::kFramesMissing;
    } else if (usual_.ns() > 0 &&
               static_cast<double>(interval) > gap_intervals_ * static_cast<double>(usual_.ns())) {
      gap = LostCause::kGapInTime;
    }
  }
  usual_.add(t_ns);
  any_ = true;
  index_ = index;
  t_ns_ = t_ns;
  return gap;
}

void LossHistory::begin_frame(std::int64_t index, std::int64_t t_ns) {
  const LostCause gap = intervals_.next(index, t_ns);
  if (lost_frames_ == 0) gap_before_ = gap;
}

void LossHistory::placed() {
  lost_frames_ = 0;
  seeing_since_ns_ = 0;
}

double LossHistory::seeing_for(bool something_in_view, std::int64_t t_ns) {
  if (!something_in_view) {
    seeing_since_ns_ = 0;
  } else if (seeing_since_ns_ == 0) {
    seeing_since_ns_ = t_ns;
  }
  return something_in_view ? static_cast<double>(t_ns - seeing_since_ns_) / 1e9 : 0;
}

}  // namespace twofold
