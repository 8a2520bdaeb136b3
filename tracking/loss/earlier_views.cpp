#include "tracking/loss/earlier_views.hpp"

#include <utility>

#include "imaging/image_buffers.hpp"

namespace twofold {
namespace {

RecentView room_for_view(const Rig& rig, const WideSearch& search) {
  RecentView view;
  allocate_images(rig, view.images);
  search.prepare(view.corners);
  return view;
}

}  // namespace

EarlierViews::EarlierViews(const Rig& rig, const WideSearchOptions& wide, const GuidedSearchOptions& guided,
                           int keyframes)
    : can_find_(wide.enabled),
      guided_(guided),
      search_(rig, wide),
      keyframes_(static_cast<std::size_t>(keyframes), room_for_view(rig, search_)),
      asked_(room_for_view(rig, search_)) {}

void EarlierViews::look_at(const FrameImages& now) {
  if (!std::exchange(looked_, true)) search_.look_at(now);
}

std::optional<SE3> EarlierViews::find(const FrameImages& earlier, FrameCorners& corners) {
  return search_.find(earlier, corners, guided_);
}

void EarlierViews::copy_corners(FrameCorners& corners) const {
  corners.clear();
  if (looked_) corners = search_.corners();
}

void EarlierViews::add_keyframe(KeyframeId id, const FrameImages& images) {
  keyframes_.add(id, images);
  copy_corners(keyframes_[0].corners);
}

const FrameImages& EarlierViews::ask(const FrameImages& now) {
  asked_.images.copy_from(now);
  copy_corners(asked_.corners);
  return asked_.images;
}

std::optional<Placement> EarlierViews::take_answer() {
  return std::exchange(answer_, std::nullopt);
}

}  // namespace twofold
