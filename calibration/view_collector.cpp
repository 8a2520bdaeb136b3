#include "calibration/view_collector.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace twofold {
namespace {

// A board that is carried to its next place is out of sight or blurred for a while: not worth a word.
constexpr int kPatience = 20;  // [frames]
// Movement from frame to frame up to which an image is sharp, and up to which two cameras without a common
// trigger see the board at the same place.
constexpr double kRest = 0.002;  // [image widths]

}  // namespace

ViewCollector::ViewCollector(const Board& board, const CollectorInput& input, const ViewGuideOptions& options)
    : board_(board), input_(input), guide_(board, input.size, options) {}

bool ViewCollector::rests(const BoardView& view) const {
  if (before_.ids != view.ids) return false;
  double most = 0;
  for (std::size_t i = 0; i < view.pixels.size(); ++i)
    most = std::max(most, cv::norm(view.pixels[i] - before_.pixels[i]));
  return most < kRest * input_.size.width;
}

ViewCollector::Sight ViewCollector::see(const Frame& frame, ViewPair* pair) {
  auto left = find_board(frame.left, board_);
  if (!left) return Sight::kNone;
  if (input_.stereo) {
    auto right = find_board(frame.right, board_);
    if (!right) return Sight::kLeftOnly;
    same_order(board_, *left, &*right);
    pair->right = *std::move(right);
  }
  pair->left = *std::move(left);
  return !input_.live || rests(pair->left) ? Sight::kUsable : Sight::kMoving;
}

void ViewCollector::look(const Frame& frame) {
  ++frames_;
  ViewPair pair;
  const Sight sight = see(frame, &pair);
  same_sight_ = sight == sight_ ? same_sight_ + 1 : 1;
  sight_ = sight;
  before_ = pair.left;
  if (sight == Sight::kNone || sight == Sight::kLeftOnly) return;
  ++found_;
  if (sight == Sight::kMoving) return;
  (void)guide_.offer(pair.left);
  offered_.push_back(std::move(pair));
}

std::string ViewCollector::progress() const {
  const auto missing = guide_.missing();
  std::string next = missing.empty() ? "complete" : "Next: " + missing[0];
  if (input_.live && !missing.empty() && same_sight_ >= kPatience) {
    if (sight_ == Sight::kNone) next = "The board is not seen";
    if (sight_ == Sight::kLeftOnly) next = "The right camera does not see the board";
    if (sight_ == Sight::kMoving) next = "Hold the board still";
  }
  return fmt::format("{} views, corners in {:.0f} % of the image. {}", guide_.chosen().size(),
                     100 * guide_.coverage(), next);
}

std::vector<ViewPair> ViewCollector::chosen() const {
  std::vector<ViewPair> pairs;
  for (const int number : guide_.chosen()) pairs.push_back(offered_[static_cast<std::size_t>(number)]);
  return pairs;
}

}  // namespace twofold
