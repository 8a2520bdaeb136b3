#include "imaging/row_offset.hpp"

#include <algorithm>
#include <cmath>

#include "base/median.hpp"
#include "base/option_check.hpp"
#include "camera/measurement.hpp"
#include "imaging/patch.hpp"

namespace twofold {
namespace {

constexpr int kBorder = 12;  // [px] room for the patch and its search

}  // namespace

std::string RowOffsetOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("corner_threshold", corner_threshold, 1)
      .at_least("min_corner_score", min_corner_score, 0)
      .at_least("min_matches", min_matches, 1)
      .above("max_spread_px", max_spread_px, 0)
      .above("max_apart_px", max_apart_px, 0)
      .reason();
}

RowOffsetMeter::RowOffsetMeter(const Rig& rig, int corners, const RowOffsetOptions& options)
    : rig_(rig), options_(options) {
  const double area = static_cast<double>(rig.camera.width) * rig.camera.height;
  cell_px_ = std::max({8, CellGrid::smallest_cell_px(rig.camera.width),
                       4 * static_cast<int>(std::lround(std::sqrt(area / corners) / 4))});
  columns_ = rig.camera.width / cell_px_ + 1;
  rows_ = rig.camera.height / cell_px_ + 1;
  occupied_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  corners_.reserve(occupied_.size());
  offsets_.reserve(occupied_.size());
}

std::optional<RowOffset> RowOffsetMeter::measure(const cv::Mat& left, const cv::Mat& right) {
  return measure_at(left, right, 0);
}

std::optional<RowOffset> RowOffsetMeter::search(const cv::Mat& left, const cv::Mat& right) {
  std::optional<RowOffset> best;
  for (int offset = -kMost; offset <= kMost; ++offset) {
    const auto measured = measure_at(left, right, offset);
    if (!measured || std::abs(measured->rows - offset) > options_.max_apart_px) continue;
    if (!best || measured->matches > best->matches) best = measured;
  }
  return best;
}

/// Rows of the right image are looked at `offset` lower.
std::optional<RowOffset> RowOffsetMeter::measure_at(const cv::Mat& left, const cv::Mat& right, int offset) {
  const cv::Range upper(0, left.rows - std::abs(offset)), lower(std::abs(offset), left.rows);
  const cv::Mat from = left.rowRange(offset > 0 ? upper : lower);
  const cv::Mat to = right.rowRange(offset > 0 ? lower : upper);
  corners_.clear();
  offsets_.clear();
  detect_corners(from, 0, options_.corner_threshold, options_.min_corner_score, kBorder,
                 {cell_px_, columns_, rows_, occupied_}, corners_);
  for (const Corner& corner : corners_) {
    const double u_r = right_from_row(from, to, rig_, corner.u, corner.v, 0, search_);
    Patch patch;
    if (!has_right(u_r) || !cut_patch(from, corner.u, corner.v, patch)) continue;
    const Eigen::Vector2f start(static_cast<float>(u_r), corner.v);
    const auto aligned = align_patch(patch, to, start, search_.refine_iterations);
    if (aligned && looks_alike(patch, aligned->rms, search_))
      offsets_.push_back(static_cast<double>(aligned->uv.y()) - corner.v);
  }
  const auto quantile_of_offsets = [&](double share) {
    return quantile(offsets_, share, QuantileRank::kLower);
  };
  if (static_cast<int>(offsets_.size()) < options_.min_matches ||
      quantile_of_offsets(0.75) - quantile_of_offsets(0.25) > 2 * options_.max_spread_px)
    return std::nullopt;
  return RowOffset{offset + quantile_of_offsets(0.5), static_cast<int>(offsets_.size())};
}

void take_back_row_offset(const cv::Mat& right, double offset, cv::Mat& out) {
  out.create(right.rows, right.cols, CV_8UC1);
  const int whole = static_cast<int>(std::floor(offset));
  constexpr int kOne = 256;
  const int share = static_cast<int>(std::lround((offset - whole) * kOne));  // of the lower row
  for (int v = 0; v < right.rows; ++v) {
    const auto* above = right.ptr<std::uint8_t>(std::clamp(v + whole, 0, right.rows - 1));
    const auto* below = right.ptr<std::uint8_t>(std::clamp(v + whole + 1, 0, right.rows - 1));
    auto* to = out.ptr<std::uint8_t>(v);
    for (int u = 0; u < right.cols; ++u)
      to[u] = static_cast<std::uint8_t>((above[u] * (kOne - share) + below[u] * share + kOne / 2) / kOne);
  }
}

cv::Mat without_row_offset(const cv::Mat& right, double offset) {
  if (offset == 0) return right;
  cv::Mat moved;
  take_back_row_offset(right, offset, moved);
  return moved;
}

}  // namespace twofold
