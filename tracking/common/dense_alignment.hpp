#pragma once

#include <span>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "imaging/image_pyramid.hpp"
#include "imaging/pixel_row.hpp"

namespace twofold {

struct DenseAlignmentOptions {
  int coarsest_level = 4;  ///< pyramid level that it starts on, in [finest_level, ImagePyramid::kLevels - 1]
  int finest_level = 1;    ///< ... and that it ends on, >= 0
  int max_iterations = 8;  ///< per level, >= 1
  float huber_grey = 8;    ///< kernel on the grey difference, > 0
  double settled_px = 0.05;  ///< stop a level when the step moves the points by less, in its pixels, >= 0
  double max_rms = 25;       ///< a pose that leaves more is not trusted [grey] > 0
  /// Share of max_rms, beyond which a pose is doubted and alignment also tried from rest, in (0, 1].
  double doubted_rms_share = 0.5;
  double light_change = 1.5;  ///< a view brighter or darker by so much is more than the solver finds, > 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Where the earlier image is compared: a pixel whose depth is known.
struct AlignmentPoint {
  Eigen::Vector2f uv;  ///< level-0 pixel of the earlier image
  Vector3 x;           ///< the point in the earlier camera's frame [m]
};

struct DenseAlignmentResult {
  SE3 T_cur_prev;
  float gain = 1;  ///< brightness of the later image = gain * earlier + offset
  float offset = 0;
  float rms = 0;      ///< robust, on the finest level [grey]
  float visible = 0;  ///< share of the points inside the later image
  bool converged = false;
};

/// Semi-dense 3D Lucas-Kanade: minimises the robust photometric error of 4x4 patches around points of known
/// depth over the pose between two frames and a common gain and offset, coarse to fine  (thesis eq. 6.7).
/// Inverse compositional: Jacobians are of the earlier image and are computed once a level.
///
/// Buffers are reserved at construction; at most `capacity` points are used.
class DenseAlignment {
 public:
  DenseAlignment(std::size_t capacity, const DenseAlignmentOptions& options);

  /// @param finest_level  where to stop when there is no time for DenseAlignmentOptions::finest_level
  [[nodiscard]] DenseAlignmentResult align(const PinholeCamera& camera, const ImagePyramid& previous,
                                           const ImagePyramid& current,
                                           std::span<const AlignmentPoint> points,
                                           const SE3& T_cur_prev_start, int finest_level = 0);

 private:
  static constexpr int kSize = 4;
  struct Pixels {          ///< of a patch
    Floats8 upper, lower;  ///< two rows each
  };
  using Row = Eigen::Matrix<float, 8, 1>;  ///< (v, omega, gain, offset)
  /// Patch of the earlier image at one level, mid-grey subtracted. The Jacobian of a pixel with respect to
  /// the pose is gradient_u * du + gradient_v * dv, with du and dv the same over the patch.
  struct Sample {
    Pixels value, gradient_u, gradient_v;
    Row du, dv;  ///< last two entries 0
  };
  struct Cost {
    float rms = 0;
    float visible = 0;
    float squares = 0, weights = 0;  ///< of residuals: w r^2, w
    Eigen::Matrix<float, 8, 8> H;
    Row g;

    /// A patch's residuals r and their weights w.
    void add(const Sample& s, const Pixels& r, const Pixels& w);
  };

  /// Sets du and dv as of this camera, the coarsest level's.
  void prepare_directions(const PinholeCamera& level_camera, std::span<const AlignmentPoint> points);
  void prepare_patches(const cv::Mat& image, int level, std::span<const AlignmentPoint> points);
  static bool prepare_patch(const cv::Mat& image, int level, const AlignmentPoint& point, Sample& sample);
  /// Pixels of the next finer level are half as wide.
  void refine_directions(std::size_t points);
  /// Normal equations of the pose of the earlier frame, the gain and the offset.
  void evaluate(const PinholeCamera& level_camera, const cv::Mat& image,
                std::span<const AlignmentPoint> points, const DenseAlignmentResult& state, Cost& cost) const;
  bool align_level(const PinholeCamera& level_camera, const cv::Mat& image,
                   std::span<const AlignmentPoint> points, DenseAlignmentResult& state) const;

  DenseAlignmentOptions options_;
  std::vector<Sample> samples_;
  std::vector<std::uint8_t> usable_;
  double mean_inverse_depth_ = 0;  ///< of the usable points [1/m]
};

}  // namespace twofold
