#include "surface/depth_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>

#include "base/check.hpp"
#include "base/right_of_way.hpp"
#include "surface/lanes.hpp"

namespace twofold {
namespace {

// Rows are worked on whole, in buffers that stay in the cache: images between the steps would cost more than
// the arithmetic.
using Row = Eigen::ArrayXf;
using ConstRow = Eigen::Map<const Row>;

ConstRow row_of(const cv::Mat& image, int y) {
  return {image.ptr<float>(y), image.cols};
}

constexpr float kMaxSpreadShare =
    0.05f;  // of the depth, across two pixels; a slope of 75 degrees stays below it
constexpr float kNone = 1e9f;

/// [m]; kNone where there is no reading.
void read_depths(const Rig& rig, const cv::Mat& depth, int y, Row& metres) {
  const auto low = static_cast<float>(rig.depth_min);
  const auto high = static_cast<float>(rig.depth_max);
  // NaN keeps no comparison.
  const auto bounded = [&](float z) { return ((z >= low) & (z <= high)) ? z : kNone; };
  if (depth.type() == CV_16UC1) {
    const auto unit = static_cast<float>(rig.depth_unit);
    const auto* row = depth.ptr<std::uint16_t>(y);
    for (int x = 0; x < depth.cols; ++x) metres[x] = bounded(unit * static_cast<float>(row[x]));
  } else {
    const auto* row = depth.ptr<float>(y);
    for (int x = 0; x < depth.cols; ++x) metres[x] = bounded(row[x]);
  }
}

/// Depths of three rows, and then of three columns, at their extremes.
class Neighbourhood {
 public:
  explicit Neighbourhood(int width) : width_(width), low_(width + 2), high_(width + 2), farthest_(width + 2) {
    low_.fill(kNone);
    high_.fill(0);
    farthest_.fill(0);
  }
  void take(const Row& above, const Row& here, const Row& below) {
    const auto seen = [](const Row& z) { return z.min(kNone - z); };  // 0 instead of kNone
    low_.segment(1, width_) = above.min(here).min(below);
    high_.segment(1, width_) = above.max(here).max(below);
    farthest_.segment(1, width_) = seen(above).max(seen(here)).max(seen(below));
  }
  /// Without a reading: kNone.
  [[nodiscard]] float nearest(int x) const { return std::min(low_[x], std::min(low_[x + 1], low_[x + 2])); }
  /// Without a reading: 0.
  [[nodiscard]] float farthest(int x) const {
    return std::max(farthest_[x], std::max(farthest_[x + 1], farthest_[x + 2]));
  }
  [[nodiscard]] bool has_hole(int x) const {
    return std::max(high_[x], std::max(high_[x + 1], high_[x + 2])) >= kNone;
  }

 private:
  int width_;
  Row low_, high_, farthest_;  // of a column, which stands one to the right
};

/// Leaves readings beside a jump out, row by row.
class JumpFilter {
 public:
  /// All must outlive it.
  JumpFilter(const Rig& rig, const cv::Mat& sensor_depth, cv::Mat& depth)
      : rig_(rig), raw_(sensor_depth), depth_(depth), around_(depth.cols) {
    for (Row& row : metres_) row.resize(depth.cols);
    for (Row& row : nearest_) row.resize(depth.cols);
  }
  /// Makes the rows of `depth` up to row y.
  void advance_to(int y) {
    for (const int last = std::min(y, depth_.rows - 1); done_ < last;) add_row(++done_);
  }
  /// As PixelReading has it, of one of the newest kKept rows.
  [[nodiscard]] const Row& nearest(int y) const { return nearest_[static_cast<std::size_t>(y % kKept)]; }

 private:
  static constexpr int kKept = 8;

  [[nodiscard]] Row& metres(int y) { return metres_[static_cast<std::size_t>(y % 3)]; }
  void add_row(int y) {
    if (y == 0) read_depths(rig_, raw_, 0, metres(0));
    if (y + 1 < depth_.rows) read_depths(rig_, raw_, y + 1, metres(y + 1));
    const Row& z = metres(y);
    around_.take(metres(std::max(y - 1, 0)), z, metres(std::min(y + 1, depth_.rows - 1)));
    auto* kept = depth_.ptr<float>(y);
    Row& near = nearest_[static_cast<std::size_t>(y % kKept)];
    for (int x = 0; x < depth_.cols; ++x) {
      const float low = around_.nearest(x);
      const float spread = around_.farthest(x) - low;
      kept[x] = ((z[x] < kNone) & (spread <= kMaxSpreadShare * low)) ? z[x] : 0.0f;
      near[x] = around_.has_hole(x) ? 0.0f : low;
    }
  }

  const Rig& rig_;
  const cv::Mat& raw_;
  cv::Mat& depth_;
  int done_ = -1;  // the last row that was made
  std::array<Row, 3> metres_;
  std::array<Row, kKept> nearest_;
  Neighbourhood around_;
};

/// Inverse depths, averaged over squares of five pixels a side as far as these have readings.
class SmoothedInverse {
 public:
  explicit SmoothedInverse(const cv::Mat& depth) : depth_(depth) {
    for (Row* row : {&inverse_, &count_}) row->setZero(depth.cols + 2 * kHalf);
    for (Inverse& row : inverses_) {
      row.value.setZero(depth.cols);
      row.seen.setZero(depth.cols);
    }
    for (Row& row : smooth_) row.setZero(depth.cols);
    for (int y = 0; y < std::min(kHalf, depth.rows); ++y) invert(y);
  }
  /// Rows are asked for with growing y, from two rows above on to two below.
  [[nodiscard]] const Row& row(int y) const { return smooth_[slot(y)]; }
  void add_row(int y) {
    const int width = depth_.cols;
    if (y + kHalf < depth_.rows) invert(y + kHalf);
    inverse_.setZero();
    count_.setZero();
    for (int r = std::max(y - kHalf, 0); r <= std::min(y + kHalf, depth_.rows - 1); ++r) {
      inverse_.segment(kHalf, width) += inverses_[slot(r)].value;
      count_.segment(kHalf, width) += inverses_[slot(r)].seen;
    }
    const auto five = [width](const Row& of) {
      return of.segment(0, width) + of.segment(1, width) + of.segment(2, width) + of.segment(3, width) +
             of.segment(4, width);
    };
    smooth_[slot(y)] = five(inverse_) / five(count_).max(0.5f);
  }

 private:
  static constexpr int kHalf = 2;
  struct Inverse {
    Row value, seen;  // 0 and 0 without a reading, else 1 / z and 1
  };

  static std::size_t slot(int y) { return static_cast<std::size_t>(y) % 5; }
  /// Once a row, not once for each of the five squares that it lies in.
  void invert(int y) {
    const ConstRow z = row_of(depth_, y);
    Inverse& row = inverses_[slot(y)];
    row.seen = (z * 1e6f).min(1.0f);  // no reading is so near
    row.value = row.seen / z.max(1e-3f);
  }

  const cv::Mat& depth_;
  Row inverse_, count_;
  std::array<Inverse, 5> inverses_;
  std::array<Row, 5> smooth_;
};

/// Inverse depth of a plane is linear in the image: w = n . (x, y, 1) on rays (x, y, 1), where n is the
/// plane's normal over its distance. So the cosine is w over the lengths of n and of the ray. The slope is
/// taken across seven pixels of a smoothed image, because that of two neighbours is mostly noise.
class Slopes {
 public:
  /// Rows of depth below a row that at_row reads.
  static constexpr int kRowsBelow = 4;

  /// The first kRowsBelow rows of the view's depth must be there.
  explicit Slopes(const DepthView& view)
      : fx_(static_cast<float>(view.camera.fx)),
        fy_(static_cast<float>(view.camera.fy)),
        cy_(static_cast<float>(view.camera.cy)),
        width_(view.depth.cols),
        height_(view.depth.rows),
        inner_(std::max(0, width_ - 2 * kHalf)),
        rx_((Row::LinSpaced(width_, 0, static_cast<float>(width_ - 1)) - static_cast<float>(view.camera.cx)) /
            fx_),
        smooth_(view.depth),
        facing_(width_),
        nx_(inner_),
        ny_(inner_),
        nz_(inner_),
        ray_(width_) {
    for (int y = 0; y < std::min(kHalf, height_); ++y) smooth_.add_row(y);
  }
  /// Rows are gone through from the first one on; the view's depth must be there as far as kRowsBelow.
  void at_row(int y) {
    if (y + kHalf < height_) smooth_.add_row(y + kHalf);
    const float ry = (static_cast<float>(y) - cy_) / fy_;
    ray_ = (rx_.square() + (ry * ry + 1)).sqrt();
    facing_.setOnes();
    if (y >= kHalf && y + kHalf < height_ && inner_ > 0) {
      const Row& w = smooth_.row(y);
      nx_ = fx_ / (2 * kHalf) * (w.tail(inner_) - w.head(inner_));
      ny_ = fy_ / (2 * kHalf) *
            (smooth_.row(y + kHalf).segment(kHalf, inner_) - smooth_.row(y - kHalf).segment(kHalf, inner_));
      nz_ = w.segment(kHalf, inner_) - nx_ * rx_.segment(kHalf, inner_) - ny_ * ry;
      nx_ = (nx_.square() + ny_.square() + nz_.square()).max(1e-12f).sqrt() * ray_.segment(kHalf, inner_);
      facing_.segment(kHalf, inner_) = (w.segment(kHalf, inner_) / nx_).min(1.0f).max(0.1f);
    }
    ray_ *= facing_;
    facing_ = 255 * facing_ + 0.5f;
  }
  /// As PixelReading::distance_per_depth.
  [[nodiscard]] const Row& distance_per_depth() const { return ray_; }
  /// In 1/255, to be cut off.
  [[nodiscard]] const Row& facing() const { return facing_; }

 private:
  static constexpr int kHalf = 2;
  float fx_, fy_, cy_;
  int width_, height_, inner_;
  Row rx_;
  SmoothedInverse smooth_;
  Row facing_, nx_, ny_, nz_, ray_;
};

/// Red, green and blue of a row in the lower three bytes; 0 without an image.
void read_colours(const cv::Mat& image, int y, std::vector<std::uint32_t>& colours) {
  if (image.empty()) return;
  const auto* colour = image.ptr<std::uint8_t>(y);
  const std::size_t width = colours.size();
  if (image.channels() == 1) {
    for (std::size_t x = 0; x < width; ++x) colours[x] = colour[x] * 0x010101U;
    return;
  }
  using Bytes = std::uint8_t __attribute__((vector_size(16)));
  std::size_t x = 0;
  for (; 3 * x + sizeof(Bytes) <= 3 * width; x += 4) {  // four pixels, and the beginning of the fifth
    const auto four = load<Bytes>(colour + 3 * x);
    const Bytes turned =
        __builtin_shufflevector(four, Bytes{}, 2, 1, 0, 16, 5, 4, 3, 16, 8, 7, 6, 16, 11, 10, 9, 16);
    std::memcpy(&colours[x], &turned, sizeof(turned));
  }
  for (; x < width; ++x)
    colours[x] = static_cast<std::uint32_t>(colour[3 * x + 2] | colour[3 * x + 1] << 8 | colour[3 * x] << 16);
}

/// Eight pixels: numbers of a kind come together, and go by the pixel.
inline void store_pixels(const Lanes& depth, const Lanes& nearest, const Lanes& distance_per_depth,
                         const Lanes& colour, PixelReading* to) {
  const auto low = [](const Lanes& a, const Lanes& b) {
    return __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
  };
  const auto high = [](const Lanes& a, const Lanes& b) {
    return __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
  };
  const Lanes low_first = low(depth, nearest), low_last = low(distance_per_depth, colour);
  const Lanes high_first = high(depth, nearest), high_last = high(distance_per_depth, colour);
  const Lanes p04 = __builtin_shufflevector(low_first, low_last, 0, 1, 8, 9, 4, 5, 12, 13);
  const Lanes p15 = __builtin_shufflevector(low_first, low_last, 2, 3, 10, 11, 6, 7, 14, 15);
  const Lanes p26 = __builtin_shufflevector(high_first, high_last, 0, 1, 8, 9, 4, 5, 12, 13);
  const Lanes p37 = __builtin_shufflevector(high_first, high_last, 2, 3, 10, 11, 6, 7, 14, 15);
  const auto store = [to](int pixel, const Lanes& two) {
    std::memcpy(static_cast<void*>(to + pixel), &two, sizeof(two));
  };
  store(0, __builtin_shufflevector(p04, p15, 0, 1, 2, 3, 8, 9, 10, 11));
  store(2, __builtin_shufflevector(p26, p37, 0, 1, 2, 3, 8, 9, 10, 11));
  store(4, __builtin_shufflevector(p04, p15, 4, 5, 6, 7, 12, 13, 14, 15));
  store(6, __builtin_shufflevector(p26, p37, 4, 5, 6, 7, 12, 13, 14, 15));
}

/// Bounds of the rows of one row of tiles.
class TileRow {
 public:
  explicit TileRow(int width) : farthest_(width), nearest_(width), least_distance_per_depth_(width) {
    clear();
  }
  void add(const ConstRow& depth, const Row& nearest, const Row& distance_per_depth) {
    farthest_ = farthest_.max(depth).max(nearest);
    nearest_ = nearest_.min(nearest);
    least_distance_per_depth_ = least_distance_per_depth_.min(distance_per_depth);
  }
  void take(DepthTile* tiles) {
    const auto width = farthest_.size();
    for (Eigen::Index left = 0; left < width; left += kDepthTile) {
      const Eigen::Index size = std::min<Eigen::Index>(kDepthTile, width - left);
      *tiles++ = {farthest_.segment(left, size).maxCoeff(), nearest_.segment(left, size).minCoeff(),
                  least_distance_per_depth_.segment(left, size).minCoeff()};
    }
    clear();
  }

 private:
  void clear() {
    farthest_.setZero();
    nearest_.fill(kNone);
    least_distance_per_depth_.fill(kNone);
  }
  Row farthest_, nearest_, least_distance_per_depth_;  // of the pixels of a column
};

/// All but the camera and the colour image.
void find_pixels(const Rig& rig, const cv::Mat& sensor_depth, DepthView& view) {
  const int width = view.depth.cols;
  JumpFilter filter(rig, sensor_depth, view.depth);
  filter.advance_to(Slopes::kRowsBelow - 1);
  Slopes slopes(view);
  TileRow tile_row(width);
  std::vector<std::uint32_t> colours(static_cast<std::size_t>(width));
  for (int y = 0; y < view.depth.rows; ++y) {
    make_way();
    filter.advance_to(y + Slopes::kRowsBelow);
    const ConstRow depth = row_of(view.depth, y);
    const Row& near = filter.nearest(y);
    slopes.at_row(y);
    read_colours(view.colour, y, colours);
    auto* pixel = view.pixels.ptr<PixelReading>(y);
    int x = 0;
    for (; x + kLanes <= width; x += kLanes) {
      const LaneIndex colour = load<LaneIndex>(&colours[static_cast<std::size_t>(x)]) |
                               whole(load<Lanes>(&slopes.facing()[x])) << 24;
      store_pixels(load<Lanes>(depth.data() + x), load<Lanes>(near.data() + x),
                   load<Lanes>(&slopes.distance_per_depth()[x]), reinterpret_cast<Lanes>(colour), pixel + x);
    }
    for (; x < width; ++x) {
      const auto facing = static_cast<std::uint32_t>(slopes.facing()[x]);
      pixel[x] = {depth[x], near[x], slopes.distance_per_depth()[x],
                  colours[static_cast<std::size_t>(x)] | facing << 24};
    }
    tile_row.add(depth, near, slopes.distance_per_depth());
    if ((y + 1) % kDepthTile == 0 || y + 1 == view.depth.rows)
      tile_row.take(view.tiles.ptr<DepthTile>(y / kDepthTile));
  }
}

}  // namespace

std::string depth_defect(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour) {
  if (depth.empty()) return "there is no depth image";
  if (depth.type() != CV_16UC1 && depth.type() != CV_32FC1)
    return fmt::format("a depth image has one channel of 16 bits or floats, this one has {} of {} bits",
                       depth.channels(), 8 * depth.elemSize1());
  const auto is_of_rig = [&](const cv::Mat& image) {
    return image.cols == rig.camera.width && image.rows == rig.camera.height;
  };
  if (!is_of_rig(depth))
    return fmt::format("the depth image is {}x{}, the camera {}x{}", depth.cols, depth.rows, rig.camera.width,
                       rig.camera.height);
  if (colour.empty()) return {};
  if (colour.type() != CV_8UC3 && colour.type() != CV_8UC1)
    return "a colour image has three channels of 8 bits, or one";
  if (!is_of_rig(colour))
    return fmt::format("the colour image is {}x{}, the camera {}x{}", colour.cols, colour.rows,
                       rig.camera.width, rig.camera.height);
  return {};
}

void prepare_depth_view(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour, DepthView& view) {
  TWOFOLD_CHECK(depth_defect(rig, depth, colour).empty(), "the depth image fits the rig");
  view.camera = rig.camera;
  view.colour = colour;
  view.depth.create(depth.size(), CV_32FC1);
  view.pixels.create(depth.size(), CV_32FC4);
  view.tiles.create((depth.rows + kDepthTile - 1) / kDepthTile, (depth.cols + kDepthTile - 1) / kDepthTile,
                    CV_32FC3);
  find_pixels(rig, depth, view);
}

DepthView make_depth_view(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour) {
  DepthView view;
  prepare_depth_view(rig, depth, colour, view);
  return view;
}

double share_of_readings(const DepthView& view) {
  return static_cast<double>(cv::countNonZero(view.depth)) / static_cast<double>(view.depth.total());
}

}  // namespace twofold
