#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "twofold/slam.hpp"
#include "twofold/viewer.hpp"

namespace twofold::python {

/// The viewer of a run, which may be opened before it begins or while it goes on.
class BrowserView {
 public:
  /// @return the address to open. Throws std::runtime_error when it is open already, the port is not to be
  /// had, or the package was built without the viewer.
  std::string open(const CameraRig& rig, const Slam& slam, const ViewerOptions& options);

  /// Of the tracker's thread: waits for nobody. T: MapEvent; PoseEstimate, FrameDetails
  template <class... T>
  void tell(const T&... what) {
    if (Viewer* viewer = shown_.load(std::memory_order_acquire)) tell(*viewer, what...);
  }
  /// Any thread but the tracker's.
  /// @param number  that poses give the frame
  void show(std::int64_t number, const FrameView& frame);

  /// Viewers get the last map and are told that the run is over; another view may be opened then.
  void close();

 private:
  static void tell(Viewer& viewer, const PoseEstimate& pose, const FrameDetails& details);
  static void tell(Viewer& viewer, const MapEvent& event);

  std::mutex opening_, showing_;
  // Shared: deleted by who made it, so that without a viewer nothing refers to one.
  std::shared_ptr<Viewer> viewer_;
  std::vector<std::shared_ptr<Viewer>> closed_;  // which the tracker may be about to tell something
  std::atomic<Viewer*> shown_{nullptr};  // release when it is made -> acquire by who tells: it is seen whole
};

}  // namespace twofold::python
