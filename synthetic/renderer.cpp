#include "synthetic/renderer.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "synthetic/view_geometry.hpp"

#ifdef __SANITIZE_THREAD__
#define TWOFOLD_ROWS_IN_TURN
#elif defined(__has_feature)  // clang++ 14 defines no macro
#if __has_feature(thread_sanitizer)
#define TWOFOLD_ROWS_IN_TURN
#endif
#endif

namespace twofold::synthetic {
namespace {

/// Rows at once; in turn under ThreadSanitizer, which knows nothing of how libtbb hands work over.
template <class Body>
void for_each_row(int rows, const Body& body) {
#ifdef TWOFOLD_ROWS_IN_TURN
  for (int row = 0; row < rows; ++row) body(row);
#else
  tbb::parallel_for(0, rows, body);
#endif
}

constexpr int kTile = 16;  ///< [px]; a multiple of RayPacket::kSize

/// Eight rooks: sub-pixel offsets with distinct rows and columns.
constexpr std::array<float, 8> kSubX{-0.4375f, -0.3125f, -0.1875f, -0.0625f,
                                     0.0625f,  0.1875f,  0.3125f,  0.4375f};
constexpr std::array<float, 8> kSubY{-0.0625f, 0.3125f, -0.3125f, 0.1875f,
                                     -0.4375f, 0.4375f, -0.1875f, 0.0625f};
constexpr float kSubFootprint = 0.5f;  ///< [px] of one of eight

class ImageCaster {
 public:
  ImageCaster(const PinholeCamera& camera, const ViewGeometry& geometry)
      : geometry_(geometry),
        width_(camera.width),
        height_(camera.height),
        columns_((camera.width + kTile - 1) / kTile),
        rows_((camera.height + kTile - 1) / kTile),
        cx_(static_cast<float>(camera.cx)),
        cy_(static_cast<float>(camera.cy)),
        inv_fx_(static_cast<float>(1 / camera.fx)),
        inv_fy_(static_cast<float>(1 / camera.fy)),
        tiles_(static_cast<std::size_t>(columns_) * rows_),
        ids_(height_, width_, CV_32SC1) {
    for (const auto& [id, b] : geometry.visible()) {
      for (int r = b.top / kTile; r <= b.bottom / kTile; ++r)
        for (int c = b.left / kTile; c <= b.right / kTile; ++c) tiles_[r * columns_ + c].push_back(id);
    }
  }

  View cast() {
    View view{cv::Mat(height_, width_, CV_32FC1), cv::Mat(height_, width_, CV_32FC1)};
    for_each_row(rows_, [&](int r) { trace_tile_row(r, view.inverse_depth); });
    for_each_row(rows_, [&](int r) {
      for (int y = r * kTile; y < std::min((r + 1) * kTile, height_); ++y) shade_row(y, view);
    });
    return view;
  }

  /// Row y of the view, into a row of the same width of another one; its neighbours say where rims are.
  void cast_row(int y, int into, View& other) {
    View view{cv::Mat(height_, width_, CV_32FC1), cv::Mat(height_, width_, CV_32FC1)};
    for (int r = 0; r < rows_; ++r) trace_tile_row(r, view.inverse_depth);
    shade_row(y, view);
    view.intensity.row(y).copyTo(other.intensity.row(into));
    view.inverse_depth.row(y).copyTo(other.inverse_depth.row(into));
  }

 private:
  [[nodiscard]] float ray_x(float u) const { return (u - cx_) * inv_fx_; }
  [[nodiscard]] float ray_y(float v) const { return (v - cy_) * inv_fy_; }
  [[nodiscard]] const std::vector<std::int32_t>& tile(int x, int y) const {
    return tiles_[(y / kTile) * columns_ + x / kTile];
  }

  void trace(const std::vector<std::int32_t>& candidates, RayPacket& rays) const {
    rays.inverse_depth.fill(0);
    rays.id.fill(RayPacket::kSky);
    for (const std::int32_t id : candidates) geometry_.intersect(id, rays);
  }

  void trace_tile_row(int row, cv::Mat& inverse_depth) {
    RayPacket rays;
    for (int y = row * kTile; y < std::min((row + 1) * kTile, height_); ++y) {
      for (int x = 0; x < width_; x += RayPacket::kSize) {
        for (int k = 0; k < RayPacket::kSize; ++k) {
          rays.x[k] = ray_x(static_cast<float>(x + k));
          rays.y[k] = ray_y(static_cast<float>(y));
        }
        trace(tile(x, y), rays);
        const int n = std::min(RayPacket::kSize, width_ - x);
        std::copy_n(rays.inverse_depth.begin(), n, inverse_depth.ptr<float>(y) + x);
        std::copy_n(rays.id.begin(), n, ids_.ptr<std::int32_t>(y) + x);
      }
    }
  }

  [[nodiscard]] bool at_rim(int x, int y) const {
    const auto* row = ids_.ptr<std::int32_t>(y);
    const std::int32_t id = row[x];
    return (x > 0 && row[x - 1] != id) || (x + 1 < width_ && row[x + 1] != id) ||
           (y > 0 && ids_.at<std::int32_t>(y - 1, x) != id) ||
           (y + 1 < height_ && ids_.at<std::int32_t>(y + 1, x) != id);
  }

  [[nodiscard]] float supersample(int x, int y) const {
    RayPacket rays;
    for (int k = 0; k < RayPacket::kSize; ++k) {
      rays.x[k] = ray_x(static_cast<float>(x) + kSubX[k]);
      rays.y[k] = ray_y(static_cast<float>(y) + kSubY[k]);
    }
    trace(tile(x, y), rays);
    std::array<float, RayPacket::kSize> grey;
    geometry_.shade(rays, kSubFootprint, grey);
    float sum = 0;
    for (const float value : grey) sum += value;
    return sum / RayPacket::kSize;
  }

  void shade_row(int y, View& view) const {
    const auto* ids = ids_.ptr<std::int32_t>(y);
    const auto* inverse_depth = view.inverse_depth.ptr<float>(y);
    auto* out = view.intensity.ptr<float>(y);
    RayPacket rays;
    std::array<bool, RayPacket::kSize> rim;
    std::array<float, RayPacket::kSize> grey;
    for (int x = 0; x < width_; x += RayPacket::kSize) {
      const int n = std::min(RayPacket::kSize, width_ - x);
      for (int k = 0; k < RayPacket::kSize; ++k) {
        rim[k] = k < n && at_rim(x + k, y);
        rays.x[k] = ray_x(static_cast<float>(x + k));
        rays.y[k] = ray_y(static_cast<float>(y));
        rays.inverse_depth[k] = k < n ? inverse_depth[x + k] : 0;
        rays.id[k] = k < n && !rim[k] ? ids[x + k] : RayPacket::kSky;
      }
      geometry_.shade(rays, 1.0f, grey);
      for (int k = 0; k < n; ++k) out[x + k] = rim[k] ? supersample(x + k, y) : grey[k];
    }
  }

  const ViewGeometry& geometry_;
  int width_, height_, columns_, rows_;
  float cx_, cy_, inv_fx_, inv_fy_;
  std::vector<std::vector<std::int32_t>> tiles_;  ///< primitives that may be seen in each tile
  cv::Mat ids_;
};

}  // namespace

View Renderer::render(const PinholeCamera& camera, const SE3& T_w_c, const std::vector<Quad>& extra) const {
  const ViewGeometry geometry(*scene_, extra, camera, T_w_c);
  return ImageCaster(camera, geometry).cast();
}

View Renderer::render_rows(const PinholeCamera& camera,
                           const std::function<Instant(int row)>& instant_of) const {
  View view{cv::Mat(camera.height, camera.width, CV_32FC1), cv::Mat(camera.height, camera.width, CV_32FC1)};
  for_each_row(camera.height, [&](int row) {
    const Instant instant = instant_of(row);
    const int top = std::max(row - 1, 0), bottom = std::min(row + 1, camera.height - 1);
    PinholeCamera strip = camera;
    strip.cy -= top;
    strip.height = bottom - top + 1;
    const ViewGeometry geometry(*scene_, instant.extra, strip, instant.T_w_c);
    ImageCaster(strip, geometry).cast_row(row - top, row, view);
  });
  return view;
}

}  // namespace twofold::synthetic
