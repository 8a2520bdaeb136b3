#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

/// Marks what the shared library exports; everything else in it is hidden.
#define TWOFOLD_API __attribute__((visibility("default")))
#define TWOFOLD_HIDDEN __attribute__((visibility("hidden")))  // what is inside of such a class

/// The public face of Twofold: `#include <twofold/slam.hpp>` and `find_package(Twofold)`.
///
/// Everywhere: metres, radians, nanoseconds. T_a_b takes points of frame b to frame a, p_a = T_a_b * p_b.
/// Camera axes: x right, y down, z forward. Pixel (0, 0) is the centre of the top-left pixel. No type here
/// changes its layout with optimisation or -march; where the standard library's types are members, that is
/// libstdc++'s, with its default ABI: no libc++, _GLIBCXX_DEBUG or _GLIBCXX_USE_CXX11_ABI=0.
namespace twofold {

/// Rigid motion T_a_b: p_a = q * p_b * q^-1 + t.
struct Pose {
  std::array<double, 4> q{0, 0, 0, 1};  ///< unit quaternion (x, y, z, w)
  std::array<double, 3> t{0, 0, 0};     ///< [m]

  friend bool operator==(const Pose&, const Pose&) = default;
};

/// T_a_c = T_a_b * T_b_c.
[[nodiscard]] TWOFOLD_API Pose compose(const Pose& T_a_b, const Pose& T_b_c);
/// T_b_a of T_a_b.
[[nodiscard]] TWOFOLD_API Pose inverse(const Pose& T_a_b);
/// p_a = T_a_b * p_b  [m].
[[nodiscard]] TWOFOLD_API std::array<double, 3> transform(const Pose& T_a_b,
                                                          const std::array<double, 3>& p_b);

/// Where the camera was at one time.
struct StampedPose {
  std::int64_t t_ns = 0;
  Pose T_world_camera;
};

/// kMono: one camera. It is placed once it has moved enough to see depth (until then it is lost, and
/// PoseEstimate::reason says what it waits for). Its map and poses are right up to their scale, in which the
/// median depth of the first map is about one. In a map that a rig made (SlamOptions::map with localise_only)
/// its poses are in metres.
enum class Sensor : std::uint8_t { kStereo, kRgbd, kMono };

/// A rectified sensor: pinhole cameras without distortion; for stereo the right one is shifted by `baseline`
/// along x, so that corresponding points lie in the same row.
struct CameraRig {
  Sensor sensor = Sensor::kStereo;
  int width = 0;   ///< [px] 1 .. 16384
  int height = 0;  ///< [px] likewise
  double fx = 0;   ///< [px] > 0
  double fy = 0;   ///< [px] > 0
  double cx = 0;   ///< [px]
  double cy = 0;   ///< [px]
  /// Distance of the two cameras [m], in (0, 20]. RGB-D: of the virtual right camera that turns depth into
  /// disparity; 0 takes 0.08, which need not be changed. kMono: unused.
  double baseline = 0;
  /// Metres per unit of the depth image, > 0; stereo: of the depth that a surface is made of, which ends at
  /// 65535 of them.
  double depth_unit = 0.001;
  double depth_min = 0.3;  ///< nearer readings are holes [m] > 0; stereo: of surfaces only, which may begin
                           ///< farther away (SurfaceModelOptions::min_stereo_depth)
  double depth_max = 8.0;  ///< farther ones likewise, finite and > depth_min
  /// Rolling shutter: from the exposure of the first row to that of the last [s], 0 to 0.5; 0: all rows at
  /// once. Nothing: not known, and found out while a camera turns to and fro; until then
  /// PoseEstimate::covariance allows for any usual readout, which makes standard deviations of single axes
  /// several times too wide, up to 15, if the shutter is a global one. Whoever knows that it is says 0.
  std::optional<double> readout = std::nullopt;
};

enum class ImageFormat : std::uint8_t {
  kGrey8,    ///< one byte a pixel
  kRgb8,     ///< three bytes a pixel; turned to grey
  kBgr8,     ///< likewise, in OpenCV's order
  kDepth16,  ///< two bytes a pixel in the machine's order, of CameraRig::depth_unit, 0: no reading
  kDepth32F  ///< a float a pixel [m]; what is not finite or not above 0: no reading; rounded to depth_unit
};

/// Pixels that belong to somebody else.
struct ImageView {
  const void* data = nullptr;  ///< first pixel of the top row; null: no image
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next, >= width * bytes a pixel
  ImageFormat format = ImageFormat::kGrey8;
};

/// The images of one instant.
struct FrameView {
  /// When it was taken: the middle of the exposure is best, of the middle row where rows are exposed one
  /// after the other. A constant offset from that shifts all poses in time and changes nothing else. Must
  /// grow from frame to frame.
  std::int64_t t_ns = 0;
  ImageView left;   ///< grey or colour
  ImageView right;  ///< stereo: as left
  ImageView depth;  ///< RGB-D: kDepth16 or kDepth32F, of the size of left and registered to it
  /// Keeps the pixels alive and unchanged: grey images and depth are then used where they are. Without it
  /// they are copied. It is let go of when the engine is done with the frame, at the latest in finish(), on
  /// any thread: one of the engine's, or one that is in a function of Slam. A deleter must not care which,
  /// and must not call Slam.
  std::shared_ptr<const void> owner;
};

}  // namespace twofold
