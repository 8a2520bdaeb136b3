#include "surface/depth_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>

#include "geometry/check.hpp"

namespace twofold {
namespace {

// Rows are worked on whole, in buffers that stay in the cache: images between the steps would cost more than
// the arithmetic.
using Row = Eigen::ArrayXf;

constexpr float kJumpRatio = 0.05f;  // of the depth, across two pixels; a slope of 75 degrees stays below it
constexpr float kNone = 1e9f;

/// [m]; kNone where there is no reading.
cv::Mat readings(const Rig& rig, const cv::Mat& depth) {
  cv::Mat metres;
  if (depth.type() == CV_16UC1) {
    depth.convertTo(metres, CV_32F, rig.depth_unit);
  } else {
    metres = depth.clone();
  }
  const auto low = static_cast<float>(rig.depth_min);
  const auto high = static_cast<float>(rig.depth_max);
  for (int y = 0; y < metres.rows; ++y) {
    auto* row = metres.ptr<float>(y);
    // NaN keeps no comparison.
    for (int x = 0; x < metres.cols; ++x) row[x] = ((row[x] >= low) & (row[x] <= high)) ? row[x] : kNone;
  }
  return metres;
}

/// Depths of three rows, and then of three columns, at their extremes.
class Neighbourhood {
 public:
  explicit Neighbourhood(const cv::Mat& raw)
      : raw_(raw), low_(raw.cols + 2), high_(raw.cols + 2), farthest_(raw.cols + 2) {
    low_.fill(kNone);
    high_.fill(0);
    farthest_.fill(0);
  }
  void at_row(int y) {
    const auto* above = raw_.ptr<float>(std::max(y - 1, 0));
    const auto* here = raw_.ptr<float>(y);
    const auto* below = raw_.ptr<float>(std::min(y + 1, raw_.rows - 1));
    const auto seen = [](float z) { return z < kNone ? z : 0.0f; };
    for (int x = 0; x < raw_.cols; ++x) {
      low_[x + 1] = std::min(above[x], std::min(here[x], below[x]));
      high_[x + 1] = std::max(above[x], std::max(here[x], below[x]));
      farthest_[x + 1] = std::max(seen(above[x]), std::max(seen(here[x]), seen(below[x])));
    }
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
  const cv::Mat& raw_;
  Row low_, high_, farthest_;  // of a column, which stands one to the right
};

/// Leaves readings beside a jump out of view.depth, and gives the pixels their neighbourhood.
void find_jumps(const cv::Mat& raw, DepthView& view) {
  Neighbourhood around(raw);
  for (int y = 0; y < raw.rows; ++y) {
    around.at_row(y);
    const auto* z = raw.ptr<float>(y);
    auto* depth = view.depth.ptr<float>(y);
    auto* pixel = view.pixels.ptr<PixelReading>(y);
    for (int x = 0; x < raw.cols; ++x) {
      const float low = around.nearest(x);
      depth[x] = ((z[x] < kNone) & (around.farthest(x) - low <= kJumpRatio * low)) ? z[x] : 0.0f;
      pixel[x].depth = depth[x];
      pixel[x].nearest = around.has_hole(x) ? 0.0f : low;
    }
  }
}

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
    const auto* z = depth_.ptr<float>(y);
    Inverse& row = inverses_[slot(y)];
    for (int x = 0; x < depth_.cols; ++x) {
      row.seen[x] = z[x] > 0 ? 1.0f : 0.0f;
      row.value[x] = row.seen[x] / std::max(z[x], 1e-3f);
    }
  }

  const cv::Mat& depth_;
  Row inverse_, count_;
  std::array<Inverse, 5> inverses_;
  std::array<Row, 5> smooth_;
};

/// Inverse depth of a plane is linear in the image: w = n . (x, y, 1) on rays (x, y, 1), where n is the
/// plane's normal over its distance. So the cosine is w over the lengths of n and of the ray. The slope is
/// taken across seven pixels of a smoothed image, because that of two neighbours is mostly noise.
void find_slopes(DepthView& view) {
  constexpr int kHalf = 2;
  const PinholeCamera& camera = view.camera;
  const int width = view.depth.cols, height = view.depth.rows, inner = std::max(0, width - 2 * kHalf);
  const auto fx = static_cast<float>(camera.fx), fy = static_cast<float>(camera.fy);
  const Row rx =
      (Row::LinSpaced(width, 0, static_cast<float>(width - 1)) - static_cast<float>(camera.cx)) / fx;
  const Row rx_inner = rx.segment(inner > 0 ? kHalf : 0, inner);
  SmoothedInverse smooth(view.depth);
  Row facing(width), nx(inner), ny(inner), nz(inner), ray(width);
  for (int y = 0; y < std::min(kHalf, height); ++y) smooth.add_row(y);
  for (int y = 0; y < height; ++y) {
    if (y + kHalf < height) smooth.add_row(y + kHalf);
    const float ry = (static_cast<float>(y) - static_cast<float>(camera.cy)) / fy;
    ray = (rx.square() + (ry * ry + 1)).sqrt();
    facing.setOnes();
    if (y >= kHalf && y + kHalf < height && inner > 0) {
      const Row& w = smooth.row(y);
      nx = fx / (2 * kHalf) * (w.tail(inner) - w.head(inner));
      ny = fy / (2 * kHalf) *
           (smooth.row(y + kHalf).segment(kHalf, inner) - smooth.row(y - kHalf).segment(kHalf, inner));
      nz = w.segment(kHalf, inner) - nx * rx_inner - ny * ry;
      nx = (nx.square() + ny.square() + nz.square()).max(1e-12f).sqrt() * ray.segment(kHalf, inner);
      facing.segment(kHalf, inner) = (w.segment(kHalf, inner) / nx).min(1.0f).max(0.1f);
    }
    ray *= facing;
    facing = 255 * facing + 0.5f;
    auto* pixel = view.pixels.ptr<PixelReading>(y);
    for (int x = 0; x < width; ++x) {
      pixel[x].slant = ray[x];
      pixel[x].colour_and_facing = static_cast<std::uint32_t>(static_cast<std::int32_t>(facing[x])) << 24;
    }
  }
}

void add_colours(DepthView& view) {
  for (int y = 0; y < view.colour.rows; ++y) {
    const auto* colour = view.colour.ptr<std::uint8_t>(y);
    auto* pixel = view.pixels.ptr<PixelReading>(y);
    if (view.colour.channels() == 3) {
      for (int x = 0; x < view.colour.cols; ++x, colour += 3)
        pixel[x].colour_and_facing |=
            static_cast<std::uint32_t>(colour[2] | colour[1] << 8 | colour[0] << 16);
    } else {
      for (int x = 0; x < view.colour.cols; ++x) pixel[x].colour_and_facing |= colour[x] * 0x010101U;
    }
  }
}

void find_tiles(DepthView& view) {
  for (int y = 0; y < view.depth.rows; ++y) {
    auto* tiles = view.tiles.ptr<DepthTile>(y / kDepthTile);
    const auto* pixel = view.pixels.ptr<PixelReading>(y);
    for (int left = 0; left < view.depth.cols; left += kDepthTile) {
      DepthTile tile = tiles[left / kDepthTile];  // a copy: the compiler keeps it in registers
      for (int x = left; x < std::min(left + kDepthTile, view.depth.cols); ++x) {
        tile.farthest = std::max(tile.farthest, std::max(pixel[x].depth, pixel[x].nearest));
        tile.nearest = std::min(tile.nearest, pixel[x].nearest);
        tile.least_slant = std::min(tile.least_slant, pixel[x].slant);
      }
      tiles[left / kDepthTile] = tile;
    }
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

DepthView make_depth_view(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour) {
  TWOFOLD_CHECK(depth_defect(rig, depth, colour).empty(), "the depth image fits the rig");
  DepthView view;
  view.camera = rig.camera;
  view.colour = colour;
  view.depth.create(depth.size(), CV_32FC1);
  view.pixels.create(depth.size(), CV_32FC4);
  view.tiles.create((depth.rows + kDepthTile - 1) / kDepthTile, (depth.cols + kDepthTile - 1) / kDepthTile,
                    CV_32FC3);
  view.tiles.setTo(cv::Scalar(0, kNone, kNone));
  find_jumps(readings(rig, depth), view);
  find_slopes(view);
  add_colours(view);
  find_tiles(view);
  return view;
}

double share_of_readings(const DepthView& view) {
  return static_cast<double>(cv::countNonZero(view.depth)) / static_cast<double>(view.depth.total());
}

}  // namespace twofold
