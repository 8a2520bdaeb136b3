// What LiveView is where the viewer was not built.
#include <stdexcept>

#include "python/live_view.hpp"

namespace twofold::python {

std::string LiveView::open(const CameraRig&, const Slam&, const ViewerOptions&) {
  throw std::runtime_error("this package was built without the viewer, which needs Node.js and Boost");
}
void LiveView::show(const FrameView&) {}
void LiveView::close() {}
void LiveView::tell(Viewer&, const PoseEstimate&) {}
void LiveView::tell(Viewer&, const MapEvent&) {}

}  // namespace twofold::python
