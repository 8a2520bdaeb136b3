#include "tracking/loss/recent_views.hpp"

#include <algorithm>

namespace twofold {

RecentViews::RecentViews(std::size_t views, const RecentView& room) : views_(views) {
  for (RecentView& view : views_) {
    view.images.copy_from(room.images);
    view.corners.corners.reserve(room.corners.corners.capacity());
    view.corners.right.reserve(room.corners.right.capacity());
  }
}

void RecentViews::add(KeyframeId id, const FrameImages& images) {
  RecentView& view = views_[next_];
  view.id = id;
  view.images.copy_from(images);
  view.corners.clear();
  next_ = (next_ + 1) % views_.size();
  size_ = std::min(size_ + 1, views_.size());
}

}  // namespace twofold
