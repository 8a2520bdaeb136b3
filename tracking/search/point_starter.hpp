#pragma once

#include <span>
#include <vector>

#include "camera/rig.hpp"
#include "camera/rolling_shutter.hpp"
#include "imaging/fast_corners.hpp"
#include "imaging/guided_search.hpp"
#include "imaging/image_pyramid.hpp"
#include "imaging/point_appearance.hpp"
#include "tracking/common/immature_points.hpp"
#include "tracking/common/lost_cause.hpp"
#include "tracking/common/quadtree.hpp"
#include "tracking/fixed/fixed_pixels.hpp"
#include "tracking/search/options.hpp"

namespace twofold {

/// One camera's options: cells so small that an image of any size has enough of them. A corner of one camera
/// says where it is only after some frames, and many never do; where all there is to see stands in a narrow
/// band of a small image, a corner for each usual cell is too few to live on.
[[nodiscard]] NewPointOptions with_cells_of_one_camera(const Rig& rig, NewPointOptions options);

/// Decides where a keyframe needs new points, and starts them with the depth of the stereo pair or depth
/// image (thesis 3.4.3, 6.3). Buffers are reserved at construction.
class PointStarter {
 public:
  /// @param search  in the right image
  /// @param fixed   of the left camera; must outlive this. Null: nothing is known of it
  PointStarter(const Rig& rig, const NewPointOptions& options, const GuidedSearchOptions& search,
               const FixedPixels* fixed = nullptr);

  /// Marks the whole image as empty.
  void clear();
  /// A point is tracked at this level-0 pixel: none is needed near it. Told of each tracked point, it knows
  /// how many there are.
  void occupy(const Eigen::Vector2f& uv);
  /// Starts points anchored in keyframe `anchor` where nothing is tracked, evenly over the image; returns how
  /// many. The anchor's pose is that at mid-exposure.
  int start(const FrameImages& images, KeyframeId anchor, const RollingShutter& shutter,
            ImmaturePoints& immature);
  /// NewPointOptions::max_points.
  [[nodiscard]] int most_points() const { return options_.max_points; }
  /// In the last start more corners had no depth than had one.
  [[nodiscard]] bool depth_is_scarce() const { return without_depth_ > with_depth_; }
  /// Points that were told of as tracked, or started, since all was empty; without those that the last start
  /// crowded into small cells, which fill none of the image that was empty before.
  [[nodiscard]] int points_in_view() const { return tracked_ - crowded_; }
  /// Patches where nothing is tracked, evenly over the image: at most `wanted` are appended to `appearances`,
  /// as its capacity allows. Marks their places as occupied.
  void choose_corners(const FrameImages& images, int wanted, std::vector<PointAppearance>& appearances);
  /// Whether corners are seen in so many cells: a quick look at level 1, where noise makes none.
  [[nodiscard]] bool sees_corners(const ImagePyramid& image, int wanted);

  /// Of a stereo pair that gives too few points: kRightCovered, or kImagesSwapped or kRowsMisaligned if the
  /// pair would give them that way, else kNoTexture. Bounded, but as much work as several starts.
  [[nodiscard]] LostCause explain_missing_depth(const FrameImages& images, int wanted);

 private:
  [[nodiscard]] int count_depths(const cv::Mat& left, const cv::Mat& right);
  [[nodiscard]] std::size_t cell_of(const Eigen::Vector2f& uv) const;
  void lay_out(int cell_px);
  /// Which corners are good enough.
  struct CornerBounds {
    int first_level = 0;
    int threshold = 0;
    float min_score = 0;
  };
  [[nodiscard]] CornerBounds usual_corners() const;
  [[nodiscard]] CornerBounds faint_corners() const;
  int start_at(const CornerBounds& bounds, int wanted, const FrameImages& images, KeyframeId anchor,
               const RollingShutter& shutter, ImmaturePoints& immature);
  void spread_corners(const FrameImages& images, const CornerBounds& bounds);
  [[nodiscard]] bool measure(const FrameImages& images, const Corner& corner, ImmaturePoint& point) const;

  Rig rig_;
  NewPointOptions options_;
  GuidedSearchOptions search_;
  const FixedPixels* fixed_;
  int columns_ = 0;
  int rows_ = 0;
  int cell_px_ = 0;                         ///< now
  std::vector<std::uint8_t> occupied_;      ///< cells
  std::vector<Eigen::Vector2f> places_;     ///< of all points that occupy a cell [px]
  int tracked_ = 0;                         ///< points that `occupy` was told of
  int with_depth_ = 0, without_depth_ = 0;  ///< corners of the last start
  int crowded_ = 0;                         ///< points of the last start that small cells gave
  std::vector<Corner> corners_;
  Quadtree quadtree_;
};

}  // namespace twofold
