#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "camera/calibration.hpp"
#include "camera/depth_registration.hpp"
#include "camera/frame.hpp"
#include "camera/rig.hpp"

namespace twofold {

struct RectifierOptions {
  int width = 0;   ///< of the rectified images [px] >= 0; 0 = as the raw left image
  int height = 0;  ///< likewise
  /// 0: every rectified pixel has a source in every raw image, unless a lens does not reach the image's
  /// edges; 1: every raw pixel has a place in the
  /// rectified one (pixels without source are black). In between: interpolates. In [0, 1].
  double field = 0.0;
  double max_half_field_deg =
      60.0;  ///< the rectified image never looks further off its axis per side, in (0, 80]

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// For every rectified pixel the raw pixel it comes from, in the form cv::remap takes (both CV_32FC1).
/// Empty when rectified and raw images are the same.
struct RectificationMap {
  cv::Mat x;
  cv::Mat y;
};

/// Turns raw images into those of a rectified Rig: no distortion, fx = fy; for stereo, both cameras parallel
/// to each other and perpendicular to the baseline, so that corresponding points lie in the same row; depth
/// of a camera of its own registered to the rectified left one.
///
/// Immutable after construction; rectify may be called from several threads at once.
class Rectifier {
 public:
  /// Throws std::runtime_error, with the reason, for an invalid calibration or options, cameras that share no
  /// view, and, at field 0, a lens that leaves more than half of the rectified image black.
  explicit Rectifier(const Calibration& calibration, const RectifierOptions& options = {});

  [[nodiscard]] const Rig& rig() const { return rig_; }
  /// The raw intensity images are rectified already and are passed through (headers only, pixels are shared).
  [[nodiscard]] bool passes_through() const { return left_.x.empty(); }

  /// Share of the rectified image that no raw pixel is seen in, of the camera that has more of them, in [0,
  /// 1].
  [[nodiscard]] double black_share() const { return black_share_; }
  /// Empty, or, from a fifth on, that share in words.
  [[nodiscard]] std::string black_note() const;

  /// Rotation from the raw to the rectified camera: x_rectified = R x_raw. A trajectory of the rectified left
  /// camera becomes one of the raw left camera through it.
  [[nodiscard]] const SO3& R_rectified_left() const { return R_rectified_left_; }
  [[nodiscard]] const SO3& R_rectified_right() const { return R_rectified_right_; }

  [[nodiscard]] const RectificationMap& left_map() const { return left_; }
  [[nodiscard]] const RectificationMap& right_map() const { return right_; }

  /// Rectifies the images that are not empty (intensity bilinear, depth nearest neighbour); index and time
  /// are copied. Buffers of `rectified` are reused when they fit, so that a warmed-up frame causes no
  /// allocation here. The raw images must have the calibrated size and the types given in Frame: check with
  /// mismatch_reason.
  void rectify(const Frame& raw, Frame& rectified) const;
  /// The left image alone, of any type and of the calibrated size (bilinear).
  [[nodiscard]] cv::Mat rectified_left(const cv::Mat& raw) const;
  /// Empty when `raw` has the images, sizes and types the calibration promises; otherwise says what is wrong.
  [[nodiscard]] std::string mismatch_reason(const Frame& raw) const;

 private:
  /// The same map as fixed-point numbers (1/32 px), which cv::remap works through about twice as fast.
  struct FixedMap {
    cv::Mat xy;
    cv::Mat fraction;
  };

  struct ImageSize {
    int width = 0, height = 0;
  };
  /// rig_.camera and what turns raw intensity images into its.
  void find_maps(const Calibration& calibration, const RectifierOptions& options);

  Rig rig_;
  ImageSize raw_left_size_, raw_right_size_, raw_depth_size_;
  SO3 R_rectified_left_;
  SO3 R_rectified_right_;
  double black_share_ = 0;
  RectificationMap left_, right_;
  FixedMap left_fixed_, right_fixed_;
  std::optional<DepthRegistration> registration_;  ///< of depth that is not the left camera's
};

}  // namespace twofold
