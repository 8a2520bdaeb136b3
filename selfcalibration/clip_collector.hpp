#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "imaging/image_pyramid.hpp"
#include "selfcalibration/clip.hpp"
#include "tracking/monocular/corner_following.hpp"

namespace twofold {

/// Cuts clips out of a video: follows corners from frame to frame, and ends a clip when half of its corners
/// have left the view. Clips overlap; each has corners of its own, so that the errors of one are not those
/// of the next.
class ClipCollector {
 public:
  /// @param width, height  of all frames [px]
  ClipCollector(int width, int height);

  /// @param image  CV_8UC1
  void add_frame(const cv::Mat& image, std::int64_t t_ns);
  /// Ends the clips under way.
  void finish();

  [[nodiscard]] const std::vector<Clip>& clips() const { return clips_; }

 private:
  struct ViewImages {
    std::size_t frame = 0;  ///< of the clip
    std::shared_ptr<const ImagePyramid> images;
  };
  struct ActiveClip {
    std::vector<FollowedCorner> corners;
    std::size_t corners_at_first = 0;
    std::vector<std::int64_t> t_ns;
    std::vector<std::vector<Eigen::Vector2f>> places;  ///< a frame, those still followed
    std::vector<ViewImages> views;                     ///< those that may become views of the clip
    double spacing_px = 0;                             ///< flow between them
  };
  void begin_clip(std::int64_t t_ns);
  [[nodiscard]] double flow(const ActiveClip& clip) const;
  void follow(std::int64_t t_ns, ActiveClip& clip) const;
  void end_clip(const ActiveClip& clip);
  void keep_image(ActiveClip& clip) const;

  int width_, height_;
  std::shared_ptr<const ImagePyramid> last_, current_;
  std::vector<ActiveClip> active_;
  std::vector<Clip> clips_;
};

}  // namespace twofold
