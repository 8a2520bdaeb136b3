#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace twofold::synthetic {

/// How texel coordinates (u, v) change over the pixels (x, y) of the image being rendered [texel/px].
struct TexelFootprint {
  float u_x = 0, u_y = 0;
  float v_x = 0, v_y = 0;
};

/// Eight places on a texture, and the footprint of each.
struct TexturePoints {
  static constexpr int kSize = 8;
  using Floats = float __attribute__((vector_size(kSize * sizeof(float))));
  Floats u, v;
  Floats u_x, u_y, v_x, v_y;  ///< TexelFootprint

  void set(int k, float at_u, float at_v, const TexelFootprint& footprint) {
    u[k] = at_u, v[k] = at_v;
    u_x[k] = footprint.u_x, u_y[k] = footprint.u_y;
    v_x[k] = footprint.v_x, v_y[k] = footprint.v_y;
  }
};

/// Grey-level texture with its pyramid of 2x2 means, read through an elliptical footprint.
///
/// A surface must look the same from any distance and angle, or sub-pixel trackers measure the renderer
/// instead of the scene. So a pixel's footprint, an ellipse in the texture, is covered by up to kMaxProbes
/// trilinear probes along its major axis, each about as wide as the minor one  (the scheme of McCormack et
/// al., "Feline", 1999).
class Texture {
 public:
  static constexpr int kMaxProbes = 8;

  /// canvas: CV_32FC1 in grey levels, at least 2x2; clamped to [0, 255] and stored with eight bits.
  explicit Texture(const cv::Mat& canvas);

  /// Mean grey levels under the footprints around (u, v); texel (0, 0) has its centre at (0, 0). Clamps at
  /// the rim.
  [[nodiscard]] TexturePoints::Floats sample(const TexturePoints& points) const;

  [[nodiscard]] float mean() const;

  [[nodiscard]] int width() const { return widths_.front(); }
  [[nodiscard]] int height() const { return heights_.front(); }

 private:
  using Floats = TexturePoints::Floats;
  using Ints = std::int32_t __attribute__((vector_size(sizeof(Floats))));

  /// Which levels of the pyramid eight probes read: `level` and, with the share `blend`, the next one.
  struct Detail {
    Ints level;
    Floats blend;
  };
  [[nodiscard]] Detail detail_of(Floats width) const;
  [[nodiscard]] Floats bilinear(Floats u, Floats v, Ints level) const;
  [[nodiscard]] Floats trilinear(Floats u, Floats v, const Detail& detail) const;

  /// By level; texel (0, 0) of each is at texels_[starts_[level]].
  std::vector<std::int32_t> widths_, heights_, starts_;
  std::vector<std::uint8_t> texels_;  ///< and three bytes that may be read with the last one
};

}  // namespace twofold::synthetic
