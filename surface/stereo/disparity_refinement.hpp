#pragma once

#include <opencv2/core/mat.hpp>

namespace twofold {

/// Finds disparities to a fraction of a pixel by aligning what surrounds each pixel with the right image.
///
/// Windows are slanted planes: disparity is d + a x + b y within one, of which all three are found by least
/// squares  (Lucas and Kanade, IJCAI 1981; slanted windows: Bleyer et al., BMVC 2011). Each pixel is warped
/// along the disparity that it has itself, and takes part in those windows whose plane it lies near: so
/// windows end where depth jumps. Three sizes of windows, about 36, 18 and 7 pixels wide, the larger ones
/// first: what they find is what the smaller ones begin with, and goes on to count where these see too little
/// texture, as far as the two agree. Differences in contrast, and in brightness that changes slowly over the
/// image, do not matter.
///
/// @param left, right  CV_8UC1, rectified
/// @param disparity    CV_32FC1 [px], right to about a pixel; 0: none
/// @return  CV_32FC1 [px]; 0 where there was none, where the windows do not match, where the disparity moved
/// by more
///          than a pixel, and where its standard deviation is above most_sigma [px]
[[nodiscard]] cv::Mat refine_disparity(const cv::Mat& left, const cv::Mat& right, const cv::Mat& disparity,
                                       double most_sigma);

}  // namespace twofold
