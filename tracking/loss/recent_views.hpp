#pragma once

#include <cstddef>
#include <vector>

#include "graph/ids.hpp"
#include "imaging/image_pyramid.hpp"
#include "tracking/loss/wide_search.hpp"

namespace twofold {

/// What a keyframe saw, or a lost frame, which has no id.
struct RecentView {
  KeyframeId id = kNoKeyframe;
  FrameImages images;
  FrameCorners corners;
};

/// The keyframes made last, as the tracker saw them: where a lost camera may still be near. A ring.
class RecentViews {
 public:
  /// @param room  for one view; copied
  RecentViews(std::size_t views, const RecentView& room);

  /// Takes the place of the oldest view. Nothing is allocated when the images are of the size of the room's.
  void add(KeyframeId id, const FrameImages& images);

  [[nodiscard]] std::size_t size() const { return size_; }
  /// @param age  0: the newest; below size()
  [[nodiscard]] RecentView& operator[](std::size_t age) {
    return views_[(next_ + views_.size() - 1 - age) % views_.size()];
  }

 private:
  std::vector<RecentView> views_;
  std::size_t next_ = 0;  ///< position of the oldest, or of a free one
  std::size_t size_ = 0;
};

}  // namespace twofold
