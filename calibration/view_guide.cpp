#include "calibration/view_guide.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/check.hpp"

namespace twofold {
namespace {

/// Root of the mean squared distance of the corners both show; a large value when they share few.
double distance_px(const BoardView& a, const BoardView& b) {
  double sum = 0;
  int common = 0;
  for (std::size_t i = 0, j = 0; i < a.ids.size() && j < b.ids.size();) {
    if (a.ids[i] < b.ids[j]) {
      ++i;
    } else if (a.ids[i] > b.ids[j]) {
      ++j;
    } else {
      const cv::Point2f d = a.pixels[i++] - b.pixels[j++];
      sum += d.dot(d);
      ++common;
    }
  }
  return common < 6 ? 1e9 : std::sqrt(sum / common);
}

/// The part of the image that shows the fewest of its cells, by name.
std::string emptiest_part(const Coverage& coverage) {
  static constexpr std::array kRowNames{"upper", "", "lower"};
  static constexpr std::array kColumnNames{"left", "", "right"};
  std::array<int, 9> empty{}, cells{};
  for (int row = 0; row < Coverage::kRows; ++row) {
    for (int column = 0; column < Coverage::kColumns; ++column) {
      const auto cell = static_cast<std::size_t>(row * Coverage::kColumns + column);
      const int part =
          3 * ((2 * row + 1) * 3 / (2 * Coverage::kRows)) + (2 * column + 1) * 3 / (2 * Coverage::kColumns);
      empty[static_cast<std::size_t>(part)] += coverage.corners[cell] == 0;
      ++cells[static_cast<std::size_t>(part)];
    }
  }
  std::size_t part = 0;
  for (std::size_t i = 1; i < empty.size(); ++i) {
    if (empty[i] * cells[part] > empty[part] * cells[i]) part = i;  // by the share of its cells
  }
  const std::string row = kRowNames[part / 3];
  const std::string column = kColumnNames[part % 3];
  if (row.empty() && column.empty()) return "middle";
  return row + (row.empty() || column.empty() ? "" : " ") + column;
}

}  // namespace

ViewGuide::ViewGuide(const Board& board, cv::Size size, const ViewGuideOptions& options)
    : board_(board),
      size_(size),
      options_(options),
      novelty_px_(options.novelty * std::hypot(size.width, size.height)),
      novelty_angle_(options.novelty_angle) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "view guide options");
}

bool ViewGuide::is_new(const Entry& entry, const std::vector<Entry>& others) const {
  return std::all_of(others.begin(), others.end(), [&](const Entry& other) {
    return distance_px(entry.view, other.view) >= novelty_px_ ||
           std::acos(std::clamp(entry.shape.normal.dot(other.shape.normal), -1.0, 1.0)) >= novelty_angle_;
  });
}

bool ViewGuide::offer(const BoardView& view) {
  const int number = offered_++;
  const auto shape = shape_of(view, board_, size_);
  if (!shape) return false;
  Entry entry{view, *shape};
  if (!is_new(entry, entries_)) return false;
  entries_.push_back(std::move(entry));
  chosen_.push_back(number);
  if (static_cast<int>(entries_.size()) > options_.max_views) thin_out();
  return !chosen_.empty() && chosen_.back() == number;
}

void ViewGuide::thin_out() {
  while (static_cast<int>(entries_.size()) > options_.max_views) {
    novelty_px_ *= 1.25;
    novelty_angle_ *= 1.25;
    std::vector<Entry> kept;
    std::vector<int> kept_numbers;
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (!is_new(entries_[i], kept)) continue;
      kept.push_back(std::move(entries_[i]));
      kept_numbers.push_back(chosen_[i]);
    }
    entries_ = std::move(kept);
    chosen_ = std::move(kept_numbers);
  }
}

double ViewGuide::coverage() const {
  Coverage coverage;
  for (const Entry& entry : entries_) coverage.add(entry.view, size_);
  return coverage.share();
}

std::vector<std::string> ViewGuide::missing() const {
  std::vector<std::string> missing;
  Coverage coverage;
  double left = 0, right = 0, up = 0, down = 0, nearest = 0, farthest = 1e9;
  for (const Entry& entry : entries_) {
    coverage.add(entry.view, size_);
    right = std::max(right, entry.shape.yaw());
    left = std::max(left, -entry.shape.yaw());
    down = std::max(down, entry.shape.pitch());
    up = std::max(up, -entry.shape.pitch());
    nearest = std::max(nearest, entry.shape.size);
    farthest = std::min(farthest, entry.shape.size);
  }
  if (coverage.share() < options_.wanted_coverage)
    missing.push_back(fmt::format("show the board in the {} of the image", emptiest_part(coverage)));
  const auto tilt = [&](double angle, const char* side) {
    if (angle < options_.wanted_tilt)
      missing.push_back(fmt::format("tilt its {} side away by 20 to 40 degrees", side));
  };
  tilt(right, "right");
  tilt(left, "left");
  tilt(down, "lower");
  tilt(up, "upper");
  if (!entries_.empty() && nearest < options_.wanted_zoom * farthest)
    missing.push_back(nearest < 0.5 ? "hold it nearer to the camera" : "hold it farther away");
  const int more = options_.wanted_views - static_cast<int>(entries_.size());
  if (more > 0) missing.push_back(fmt::format("{} more views", more));
  return missing;
}

}  // namespace twofold
