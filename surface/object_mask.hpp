#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "camera/rig.hpp"

namespace twofold {

/// What separates an object from the place it stands in.
struct ObjectMaskOptions {
  double farthest = 0.8;  ///< depth cut: nothing beyond belongs to the object [m] > 0
  bool held = false;  ///< by hand, before a camera: it stands on nothing, and the depth cut alone says what
                      ///< it is
  double above = 0.003;  ///< the object begins this far above the support plane, or four standard deviations
                         ///< of the depth, whichever is more [m] >= 0
  int erode = 2;         ///< pixels taken from the mask's rim, where depths mix, in [0, 20]
  double depth_noise = 0.0;  ///< to be set: standard deviation of a depth z is depth_noise z^2 [1/m] > 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// The plane that an object stands on, in the camera's frame: height of x_c is normal . x_c + offset [m].
struct SupportPlane {
  Vector3 normal{0, 0, 0};  ///< unit, towards the camera's side
  double offset = 0;

  [[nodiscard]] double height(const Vector3& x_c) const { return normal.dot(x_c) + offset; }
};

/// Finds the object in depth images of a camera that looks down at it  (after thesis 6.5.3): what is near
/// enough, stands on the plane that most of that lies in, and holds together. Where two planes lie above each
/// other, as a turntable on a table, the upper one is meant. Of a thing that is held by hand, what is near
/// enough and holds together, the hand with it.
///
/// The first plane is searched for by random samples, always the same ones; later images start from the plane
/// of the one before, so that a camera may walk. Same calls, same masks. One thread at a time.
class ObjectMasker {
 public:
  /// options must be valid.
  ObjectMasker(const Rig& rig, const ObjectMaskOptions& options);

  /// 255 on the object, else 0 (CV_8UC1); or in words what was not found.
  /// @param depth  CV_16UC1 of the rig's size (checked), in units of Rig::depth_unit; 0: no reading
  [[nodiscard]] tl::expected<cv::Mat, std::string> mask(const cv::Mat& depth);

  /// Of the last image that had one.
  [[nodiscard]] const SupportPlane& plane() const { return plane_; }
  /// Upwards in the camera's frame, unit: that plane's normal; of a thing that is held, upwards in the image.
  [[nodiscard]] Vector3 up() const { return options_.held ? Vector3(0, -1, 0) : plane_.normal; }

 private:
  [[nodiscard]] std::vector<Vector3> near_points(const cv::Mat& depth) const;
  [[nodiscard]] double within(double z) const;
  [[nodiscard]] std::vector<Vector3> on_plane(const std::vector<Vector3>& points,
                                              const SupportPlane& plane) const;
  [[nodiscard]] bool refine(const std::vector<Vector3>& points, SupportPlane& plane) const;
  [[nodiscard]] bool search(const std::vector<Vector3>& points, SupportPlane& plane) const;
  void raise(const std::vector<Vector3>& points, SupportPlane& plane) const;
  /// Empty, or in words what was not found.
  [[nodiscard]] std::string find_plane(const cv::Mat& depth);
  /// What is near enough, and above the plane if the object stands on one.
  [[nodiscard]] cv::Mat candidates(const cv::Mat& depth) const;

  Rig rig_;
  ObjectMaskOptions options_;
  SupportPlane plane_;
  bool has_plane_ = false;
};

/// An image in which nothing but what the mask shows can be followed: each pixel outside takes the grey level
/// of the nearest one inside, smoothed, so that no edge marks where the mask ends. CV_8UC1; with an empty
/// mask, of one grey.
[[nodiscard]] cv::Mat fill_outside(const cv::Mat& image, const cv::Mat& mask);

/// Whether a mask comes so near to the image's border that what it shows may go on beyond it.
/// @param erode  ObjectMaskOptions::erode, with which the mask was made
[[nodiscard]] bool reaches_border(const cv::Mat& mask, int erode);

/// The mask as the right camera of a pair sees it: each pixel moved by its disparity.
/// @param depth  of the left image, CV_16UC1 in units of Rig::depth_unit
[[nodiscard]] cv::Mat mask_in_right(const Rig& rig, const cv::Mat& mask, const cv::Mat& depth);

}  // namespace twofold
