// What BrowserView is where the viewer was not built.
#include <stdexcept>

#include "python/browser_view.hpp"

namespace twofold::python {

std::string BrowserView::open(const CameraRig&, const Slam&, const ViewerOptions&) {
  throw std::runtime_error("this package was built without the viewer, which needs Node.js and Boost");
}
void BrowserView::show(std::int64_t, const FrameView&) {}
void BrowserView::close() {}
void BrowserView::tell(Viewer&, const PoseEstimate&, const FrameDetails&) {}
void BrowserView::tell(Viewer&, const MapEvent&) {}

}  // namespace twofold::python
