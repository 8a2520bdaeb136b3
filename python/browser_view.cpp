#include "python/browser_view.hpp"

#include <stdexcept>

namespace twofold::python {

std::string BrowserView::open(const CameraRig& rig, const Slam& slam, const ViewerOptions& options) {
  const std::scoped_lock lock(opening_);
  if (viewer_) throw std::runtime_error("the viewer is open at " + viewer_->address());
  viewer_ = std::make_shared<Viewer>(
      rig, [&slam] { return slam.map(); }, options);
  shown_.store(viewer_.get(), std::memory_order_release);
  return viewer_->address();
}

void BrowserView::show(std::int64_t number, const FrameView& frame) {
  const std::scoped_lock lock(showing_);
  Viewer* viewer = shown_.load(std::memory_order_acquire);
  if (viewer != nullptr && viewer->wants_image()) viewer->show(number, frame.left, frame.owner);
}

void BrowserView::close() {
  const std::scoped_lock lock(opening_);
  if (!viewer_) return;
  viewer_->finish();
  shown_.store(nullptr, std::memory_order_release);
  closed_.push_back(std::move(viewer_));
}

void BrowserView::tell(Viewer& viewer, const PoseEstimate& pose, const FrameDetails& details) {
  viewer.tell(pose, details);
}

void BrowserView::tell(Viewer& viewer, const MapEvent& event) {
  viewer.tell(event);
}

}  // namespace twofold::python
