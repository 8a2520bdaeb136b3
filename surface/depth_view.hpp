#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>

#include "camera/rig.hpp"

namespace twofold {

/// What a pixel says, together in memory, because samples of the surface ask for it all.
struct PixelReading {
  float depth = 0;    ///< [m]; 0: no reading
  float nearest = 0;  ///< the smallest depth of the pixel and its eight neighbours [m]; 0 if one has none
  /// Distance from the surface for each metre of depth before it: facing times the ray's length.
  float distance_per_depth = 0;
  /// From the lowest byte on: red, green, blue (0 without an image), and the cosine of the angle between ray
  /// and surface normal in 1/255, at least a tenth.
  std::uint32_t colour_and_facing = 0;
};

inline constexpr int kDepthTile = 8;  ///< pixels along an edge of a DepthTile

/// Bounds of the readings in a square of pixels.
struct DepthTile {
  float farthest = 0;  ///< no PixelReading::depth or ::nearest is larger [m]
  float nearest = 0;   ///< no reading, nor any neighbour's, is nearer [m]; 0 if one of them is missing
  float least_distance_per_depth = 0;  ///< of PixelReading::distance_per_depth
};

/// A depth image as fusion reads it.
struct DepthView {
  PinholeCamera camera;
  cv::Mat depth;   ///< CV_32FC1 [m]; 0: no reading
  cv::Mat pixels;  ///< CV_32FC4, a PixelReading each
  cv::Mat tiles;   ///< CV_32FC3, a DepthTile each
  cv::Mat colour;  ///< CV_8UC3 (blue, green, red) or CV_8UC1; may be empty

  [[nodiscard]] const PixelReading& pixel(int y, int x) const { return pixels.ptr<PixelReading>(y)[x]; }
};

/// Why a depth image, and a colour image beside it if it is not empty, do not fit the rig; empty when they
/// do. depth: CV_16UC1 in units of Rig::depth_unit, or CV_32FC1 [m]; colour: CV_8UC3 or CV_8UC1.
[[nodiscard]] std::string depth_defect(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour);

/// Prepares a depth image for fusion; it and colour must have no depth_defect. Readings that are not finite,
/// out of the rig's range, or beside a jump in depth, where sensors see a mixture of both sides, are left
/// out. Takes the memory that `view` has from an image of the same size before: 6 MB at 640 x 480, which the
/// kernel would give page by page each time.
void prepare_depth_view(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour, DepthView& view);
/// Likewise, into memory of its own.
[[nodiscard]] DepthView make_depth_view(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour);

/// Share of pixels with a reading, in [0, 1].
[[nodiscard]] double share_of_readings(const DepthView& view);

}  // namespace twofold
