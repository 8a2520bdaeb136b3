#include "calibration/view_collector.hpp"

#include <algorithm>
#include <limits>

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

double movement(const BoardView& before, const BoardView& now) {
  double most = 0;
  std::size_t common = 0;
  for (std::size_t i = 0; i < now.ids.size(); ++i) {
    const auto at = std::lower_bound(before.ids.begin(), before.ids.end(), now.ids[i]);
    if (at == before.ids.end() || *at != now.ids[i]) continue;
    const auto there = static_cast<std::size_t>(at - before.ids.begin());
    most = std::max(most, cv::norm(now.pixels[i] - before.pixels[there]));
    ++common;
  }
  const std::size_t more = std::max(before.ids.size(), now.ids.size());
  return common > 0 && 4 * common >= 3 * more ? most : std::numeric_limits<double>::infinity();
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
  const bool rests = movement(before_, pair->left) < kRest * input_.size.width;
  return !input_.live || rests ? Sight::kUsable : Sight::kMoving;
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
  if (guide_.offer(pair.left)) chosen_.emplace(offered_, std::move(pair));
  ++offered_;
  std::erase_if(chosen_, [&](const auto& view) {  // a better one may have taken its place
    return !std::binary_search(guide_.chosen().begin(), guide_.chosen().end(), view.first);
  });
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
  for (const auto& [number, pair] : chosen_) pairs.push_back(pair);
  return pairs;
}

}  // namespace twofold
