#pragma once

#include <map>
#include <optional>
#include <vector>

#include "camera/frame.hpp"
#include "structure/options.hpp"
#include "structure/stereo_features.hpp"
#include "structure/surface_tracks.hpp"

namespace twofold {

/// A point of the surface, as last estimated while it was in the filter's state.
struct StructurePoint {
  Vector3 x_w = Vector3::Zero();         ///< world: the first camera's frame [m]
  Matrix3 covariance = Matrix3::Zero();  ///< against the first camera [m^2]
  std::int64_t first_frame = 0;
  Vector2 first_uv = Vector2::Zero();  ///< left pixel of that frame
  std::uint8_t grey = 0;
  int measurements = 0;
};

/// What became of one frame.
struct StructureFrame {
  std::int64_t t_ns = 0;
  bool tracked = false;  ///< enough landmarks were measured; otherwise the filter starts anew here
  SE3 T_c_w;             ///< as known at the frame's time
  SE3 T_c_w_smoothed;    ///< as known when the frame left the window
  int matches = 0;       ///< to the frame before
  int consistent = 0;    ///< of them, as one rigid body
  int measured = 0;      ///< landmarks found again
  int started = 0;       ///< new landmarks
  FilterSummary summary;
};

/// Surface structure from a moving stereo camera in constant time  (SWF 4.1). All features of two frames are
/// matched with each other; Moravec's check and robust motion-only adjustment give the motion; landmarks are
/// measured by patches warped through the homography of their plane, and measured again after Gauss-Newton
/// steps; the sliding window filter estimates poses and landmarks.
///
/// Single-threaded; the same frames give the same result. Stereo only.
class StructureFilter {
 public:
  /// Throws std::runtime_error when the options are invalid or the rig is not stereo.
  StructureFilter(const Rig& rig, const StructureOptions& options);

  const StructureFrame& process(const Frame& frame);

  [[nodiscard]] const std::vector<StructureFrame>& frames() const { return frames_; }
  /// All points ever started, by id.
  [[nodiscard]] const std::map<std::int64_t, StructurePoint>& points() const { return points_; }
  [[nodiscard]] int restarts() const { return restarts_; }

 private:
  [[nodiscard]] std::optional<SE3> estimate_motion(const std::vector<StereoFeature>& current,
                                                   StructureFrame& report) const;
  [[nodiscard]] std::vector<SurfaceTrack> measure_tracks(const SE3& T_c_w) const;
  void start_filter(const SE3& T_c_w);
  void start_tracks(const std::vector<StereoFeature>& features, StructureFrame& report);
  void update(const StructureFrame& report, int found_again);
  void give_up_outliers();
  void take_estimates();

  Rig rig_;
  StructureOptions options_;
  FrameImages images_;
  std::vector<StereoFeature> previous_;  ///< features of the frame before
  std::vector<SurfaceTrack> tracks_;     ///< measured in the newest frame
  std::map<std::int64_t, SE3> anchors_;  ///< T_a_w by frame, of frames that tracks started in
  std::optional<SlidingWindowFilter> filter_;
  std::int64_t filter_start_ = 0;  ///< frame the filter counts from
  std::int64_t next_id_ = 0;
  std::vector<StructureFrame> frames_;
  std::map<std::int64_t, StructurePoint> points_;
  int restarts_ = 0;
  FilterSummary summary_;
};

}  // namespace twofold
