#include "io/sources/bag_image_order.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "evaluation/tum_line.hpp"

namespace twofold {
BagImageOrder::BagImageOrder(std::int64_t interval_ns)
    : far_ns_(interval_ns == 0 ? 0 : std::max(10 * interval_ns, std::int64_t{1'000'000'000})) {}

bool BagImageOrder::is_far(std::int64_t t_ns) const {
  return far_ns_ > 0 && (!last_ || t_ns - *last_ > far_ns_);
}

void BagImageOrder::accept_waiting(std::deque<BagImage>& in_order) {
  for (BagImage& image : beyond_jump_) in_order.push_back(std::move(image));
  beyond_jump_.clear();
  last_ = in_order.back().t_ns;
}

std::vector<std::string> BagImageOrder::add(BagImage image, std::deque<BagImage>& in_order) {
  std::vector<std::string> left_out;
  const bool waiting = !beyond_jump_.empty();
  if (waiting && image.t_ns < beyond_jump_.front().t_ns && !(last_ && image.t_ns <= *last_)) {
    for (const BagImage& wrong : beyond_jump_)
      left_out.push_back(fmt::format("is of {} s, after a later one, of {} s", seconds_text(wrong.t_ns),
                                     seconds_text(image.t_ns)));
    beyond_jump_.clear();
  }
  const auto before = beyond_jump_.empty() ? last_ : std::optional(beyond_jump_.back().t_ns);
  if (before && image.t_ns <= *before) {
    left_out.push_back(fmt::format("is of {} s, not after the one before it, of {} s",
                                   seconds_text(image.t_ns), seconds_text(*before)));
    return left_out;
  }
  if (beyond_jump_.empty() && !is_far(image.t_ns)) {
    last_ = image.t_ns;
    in_order.push_back(std::move(image));
    return left_out;
  }
  beyond_jump_.push_back(std::move(image));
  if (beyond_jump_.size() == kConfirmed) accept_waiting(in_order);
  return left_out;
}

std::vector<std::string> BagImageOrder::finish(std::deque<BagImage>& in_order) {
  if (beyond_jump_.empty()) return {};
  if (!last_ || beyond_jump_.size() > 1) {
    accept_waiting(in_order);
    return {};
  }
  const std::string alone = fmt::format("is the last one and of {} s, long after the one before it, of {} s",
                                        seconds_text(beyond_jump_.front().t_ns), seconds_text(*last_));
  beyond_jump_.clear();
  return {alone};
}

}  // namespace twofold
