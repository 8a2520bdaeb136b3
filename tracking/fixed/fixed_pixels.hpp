#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "geometry/types.hpp"
#include "tracking/fixed/image_motion.hpp"

namespace twofold {

struct FixedPixelOptions {
  bool enabled = true;
  /// By which the scene must have moved at a pixel between two looks, whatever its depth, > 0.
  double min_motion_px = 8;
  int same_grey = 3;  ///< a pixel that has changed by more shows the scene, in [0, 254]
  /// A pixel is telling if it differs by so much from what lies along the motion, in [same_grey + 1, 254].
  int min_contrast = 12;
  int believed = 5;          ///< looks at which a telling pixel must have stayed the same, in [2, 100]
  double look_period = 0.2;  ///< time in which all of the image is looked at once [s], > 0
  /// Of the image: when more seems fixed, no region is believed to be, in (0, 1].
  double max_fixed_share = 0.5;
  /// Of the points found in a frame, in (0, 1]: with fewer inliers its pose says nothing of pixels.
  double min_inlier_share = 0.5;
  /// What a pixel is compared with lies so far to either side, along the motion; as wide a rim of the image
  /// is not looked at, in [1, 32].
  int aside_px = 4;
  int max_votes = 2;           ///< times `believed`: beyond, votes are not counted, in [1, 255 / believed]
  int against = 4;             ///< votes that a change takes back, in [1, 255]
  int min_in_quarter = 16;     ///< fixed pixels that cover a quarter of a block, in [1, 256], ...
  int max_telling = 2;         ///< ... unless more than so many times as many are telling, >= 1
  int more_alone = 2;          ///< votes beyond `believed` of a pixel of which no neighbour says the same,
                               ///< in [0, (max_votes - 1) * believed]
  int touching = 3;            ///< fixed pixels of a neighbourhood that are no single ones, in [1, 9]
  int rest = 2;                ///< periods in which a block that clearly shows the scene is not looked at,
                               ///< in [0, 255]
  int chance = 2;              ///< votes that a pixel of the scene gets now and then, in [0, believed - 1]
  double chance_share = 0.25;  ///< of the telling pixels, that stay the same by chance, in (0, 1]
  double far_share =
      0.1;            ///< of the tracked points, that may be farther than what is looked at, in [0, 0.99]
  double nearer = 2;  ///< times: what is not tracked may be so much nearer than what is, >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Learns which pixels show what moves with the camera: a bonnet, a robot's own arm, a caption, dirt, dead
/// pixels. They stay the same while the camera's motion moves the scene behind them.
///
/// The image is looked at in blocks, some in each frame, in turn. Where the scene has moved far enough since
/// a block was looked at last, whatever its depth, each of its pixels votes: one that differs from what lies
/// along the motion, and is the same as before, for being fixed; one that has changed against it, several
/// times as much. A camera at rest, the direction of travel and plain surfaces give no votes. A block in
/// which nothing seems fixed rests for some periods.
///
/// One instance a camera. No allocation after construction; bounded work.
class FixedPixels {
 public:
  FixedPixels(int width, int height, const FixedPixelOptions& options);

  /// The newest frame's image (CV_8UC1) as the camera gave it, nothing repaired. How much of it is looked at
  /// follows from the time since the last one, so that all of it costs the same share of the time at any
  /// rate.
  void look_at(const cv::Mat& image, std::int64_t t_ns, ImageMotion& motion);

  /// What is seen around this pixel is fixed: nothing of the scene is found there.
  [[nodiscard]] bool covers(const Vector2& uv) const;
  /// A patch of pyramid level `level` at this level-0 pixel has several fixed pixels.
  [[nodiscard]] bool touches(const Eigen::Vector2f& uv, int level) const;
  /// Fixed pixels that stand alone: dead ones.
  [[nodiscard]] std::span<const cv::Point> dead() const { return dead_; }

 private:
  static constexpr int kSide = 32;  ///< of a block [px]
  static constexpr int kArea = kSide * kSide;
  static constexpr std::size_t kMostDead = 24;  ///< in a block; more are no single ones
  using Rows = std::array<std::uint32_t, kSide>;
  struct Block {
    int u = 0, v = 0;         ///< its first pixel
    std::int64_t taken = -1;  ///< frame that `before` is of
    std::uint8_t rest = 0;    ///< periods until it is looked at again
    std::array<std::uint8_t, kArea> before{}, votes{};
    bool has_fixed = false;
    std::uint8_t covered = 0;  ///< quarters of it that are fixed, a bit each
    std::uint8_t dead_count = 0;
    std::array<std::uint16_t, kMostDead> dead{};  ///< positions
  };

  static void prefetch(const cv::Mat& image, const Block& block);
  void look_at_block(const cv::Mat& image, ImageMotion& motion, Block& block);
  void vote(const cv::Mat& image, const Vector2& motion_px, Block& block);
  void sum_up(const Rows& fixed, const Rows& telling, Block& block);
  void list_dead();
  [[nodiscard]] const Block* block_at(int u, int v) const;
  [[nodiscard]] bool is_believable() const {
    return covered_ <= options_.max_fixed_share * 4 * static_cast<double>(blocks_.size());
  }

  FixedPixelOptions options_;
  int columns_ = 0, rows_ = 0;
  std::vector<Block> blocks_;
  std::size_t next_ = 0;  ///< block to be looked at
  std::int64_t last_ns_ = 0;
  int covered_ = 0;  ///< quarters of blocks
  std::vector<cv::Point> dead_;
};

}  // namespace twofold
