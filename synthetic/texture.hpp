#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
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

  /// Mean grey level under the footprint around (u, v); texel (0, 0) has its centre at (0, 0). Clamps at the
  /// rim.
  [[nodiscard]] float sample(float u, float v, const TexelFootprint& footprint) const;

  /// The same at eight places, to the last bit.
  void sample(const TexturePoints& points, std::span<float, TexturePoints::kSize> grey) const;

  [[nodiscard]] float mean() const;

  [[nodiscard]] int width() const { return levels_.front().width; }
  [[nodiscard]] int height() const { return levels_.front().height; }

 private:
  /// All probes of a footprint side by side; of those after the first `count` nobody looks at the value. Each
  /// is computed as a single one is, to the last bit.
  using Probes = float __attribute__((vector_size(kMaxProbes * sizeof(float))));

  struct Level {
    int width = 0;
    int height = 0;
    std::vector<std::uint8_t> texels;

    [[nodiscard]] float bilinear(float u, float v) const;
    [[nodiscard]] Probes bilinear(Probes u, Probes v, int count) const;
  };
  /// Mean over `count` probes that lie along (along_u, along_v), each `width` texels wide.
  [[nodiscard]] float probe(float u, float v, int count, float width, float along_u, float along_v) const;
  [[nodiscard]] float trilinear(float u, float v, int level, float blend) const;
  [[nodiscard]] Probes trilinear(Probes u, Probes v, int level, float blend, int count) const;

  std::vector<Level> levels_;
};

}  // namespace twofold::synthetic
