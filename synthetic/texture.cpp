#include "synthetic/texture.hpp"

#ifdef __AVX__
#include <immintrin.h>
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "base/check.hpp"

namespace twofold::synthetic {
namespace {

/// log2 of a positive normal number, exact at powers of two and linear between them (error < 0.09): enough to
/// blend two pyramid levels, and the same on every machine.
float coarse_log2(float x) {
  const auto bits = std::bit_cast<std::uint32_t>(x);
  const auto exponent = static_cast<int>(bits >> 23) - 127;
  const float mantissa = std::bit_cast<float>((bits & 0x007fffffU) | 0x3f800000U);
  return static_cast<float>(exponent) + (mantissa - 1.0f);
}

using Floats = TexturePoints::Floats;
using Ints = std::int32_t __attribute__((vector_size(sizeof(Floats))));

float larger(float a, float b) {
  return std::max(a, b);
}
Floats larger(Floats a, Floats b) {
  return a < b ? b : a;
}
float magnitude(float x) {
  return std::abs(x);
}
Floats magnitude(Floats x) {
  return x < 0.0f ? -x : x;
}
float root(float x) {
  return std::sqrt(x);
}
Floats root(Floats x) {
#ifdef __AVX__
  return _mm256_sqrt_ps(x);
#else
  for (int k = 0; k < TexturePoints::kSize; ++k) x[k] = std::sqrt(x[k]);
  return x;
#endif
}

/// One number or eight.
template <class Number>
struct Ellipse {
  Number major{}, minor{};      ///< lengths of the axes [texel/px]
  Number major_u{}, major_v{};  ///< the major axis itself [texel/px]
};

/// Image of the unit circle of a pixel: singular values and first left singular vector of the 2x2 footprint.
template <class Number>
Ellipse<Number> ellipse_of(const Number& u_x, const Number& u_y, const Number& v_x, const Number& v_y) {
  const Number uu = u_x * u_x + u_y * u_y;
  const Number vv = v_x * v_x + v_y * v_y;
  const Number uv = u_x * v_x + u_y * v_y;
  const Number difference = uu - vv;
  const Number largest = 0.5f * (uu + vv + root(difference * difference + 4 * uv * uv));
  const Number determinant = magnitude(u_x * v_y - u_y * v_x);
  Ellipse<Number> e;
  e.major = root(largest) + 1e-6f;
  e.minor = determinant / e.major;
  // Of the two equivalent eigenvector formulas, the one without cancellation.
  const Number a_u = difference >= 0 ? largest - vv : uv;
  const Number a_v = difference >= 0 ? uv : largest - uu;
  const Number norm = root(a_u * a_u + a_v * a_v);
  const Number scale = norm > 1e-12f ? e.major / norm : Number{};
  e.major_u = a_u * scale;
  e.major_v = a_v * scale;
  return e;
}

/// How much longer the ellipse is than a probe may be wide.
template <class Number>
Number probes_wanted(const Ellipse<Number>& e) {
  return e.major /
         larger(larger(e.minor, Number{} + 1.0f), e.major / static_cast<float>(Texture::kMaxProbes));
}

}  // namespace

Texture::Texture(const cv::Mat& canvas) {
  TWOFOLD_CHECK(canvas.type() == CV_32FC1 && canvas.cols >= 2 && canvas.rows >= 2, "texture canvas");
  Level base{canvas.cols, canvas.rows, {}};
  base.texels.resize(static_cast<std::size_t>(base.width) * base.height);
  for (int y = 0; y < base.height; ++y) {
    const auto* row = canvas.ptr<float>(y);
    auto* out = base.texels.data() + static_cast<std::size_t>(y) * base.width;
    for (int x = 0; x < base.width; ++x)
      out[x] = static_cast<std::uint8_t>(std::clamp(row[x], 0.0f, 255.0f) + 0.5f);
  }
  levels_.push_back(std::move(base));
  while (levels_.back().width >= 4 && levels_.back().height >= 4) {
    const Level& fine = levels_.back();
    Level coarse{fine.width / 2, fine.height / 2, {}};
    coarse.texels.resize(static_cast<std::size_t>(coarse.width) * coarse.height);
    for (int y = 0; y < coarse.height; ++y) {
      const auto* above = fine.texels.data() + static_cast<std::size_t>(2 * y) * fine.width;
      const auto* below = above + fine.width;
      auto* out = coarse.texels.data() + static_cast<std::size_t>(y) * coarse.width;
      for (int x = 0; x < coarse.width; ++x) {
        const int sum = above[2 * x] + above[2 * x + 1] + below[2 * x] + below[2 * x + 1];
        // Ties alternate so that rounding does not brighten the pyramid from level to level.
        out[x] = static_cast<std::uint8_t>((sum + 1 + ((x + y) & 1)) >> 2);
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

float Texture::Level::bilinear(float u, float v) const {
  u = std::min(std::max(u, 0.0f), static_cast<float>(width - 1));
  v = std::min(std::max(v, 0.0f), static_cast<float>(height - 1));
  const int x = std::min(static_cast<int>(u), width - 2);
  const int y = std::min(static_cast<int>(v), height - 2);
  const float a = u - static_cast<float>(x);
  const float b = v - static_cast<float>(y);
  const auto* p = texels.data() + static_cast<std::size_t>(y) * width + x;
  const auto* q = p + width;
  const float top = static_cast<float>(p[0]) + a * static_cast<float>(p[1] - p[0]);
  const float bottom = static_cast<float>(q[0]) + a * static_cast<float>(q[1] - q[0]);
  return top + b * (bottom - top);
}

Texture::Probes Texture::Level::bilinear(Probes u, Probes v, int count) const {
  const Probes last_u = Probes{} + static_cast<float>(width - 1),
               last_v = Probes{} + static_cast<float>(height - 1);
  u = u > 0.0f ? u : Probes{};
  v = v > 0.0f ? v : Probes{};
  u = u < last_u ? u : last_u;
  v = v < last_v ? v : last_v;
  Ints x = __builtin_convertvector(u, Ints), y = __builtin_convertvector(v, Ints);
  x = x < width - 2 ? x : Ints{} + (width - 2);
  y = y < height - 2 ? y : Ints{} + (height - 2);
  const Probes a = u - __builtin_convertvector(x, Probes);
  const Probes b = v - __builtin_convertvector(y, Probes);
  const Ints at = y * width + x;
  Ints p0{}, p1{}, q0{}, q1{};
  for (int i = 0; i < count; ++i) {
    const auto* p = texels.data() + at[i];
    const auto* q = p + width;
    p0[i] = p[0], p1[i] = p[1];
    q0[i] = q[0], q1[i] = q[1];
  }
  const Probes top = __builtin_convertvector(p0, Probes) + a * __builtin_convertvector(p1 - p0, Probes);
  const Probes bottom = __builtin_convertvector(q0, Probes) + a * __builtin_convertvector(q1 - q0, Probes);
  return top + b * (bottom - top);
}

Texture::Probes Texture::trilinear(Probes u, Probes v, int level, float blend, int count) const {
  const float scale = std::bit_cast<float>(static_cast<std::uint32_t>(127 - level) << 23);
  const Probes fine_u = (u + 0.5f) * scale - 0.5f;
  const Probes fine_v = (v + 0.5f) * scale - 0.5f;
  const Probes fine = levels_[level].bilinear(fine_u, fine_v, count);
  if (blend == 0) return fine;
  const Probes coarse = levels_[level + 1].bilinear(0.5f * fine_u - 0.25f, 0.5f * fine_v - 0.25f, count);
  return fine + blend * (coarse - fine);
}

float Texture::trilinear(float u, float v, int level, float blend) const {
  // Texel i of level l covers base texels [2^l (i + 0.5) - 0.5 -+ 2^l / 2].
  const float scale = std::bit_cast<float>(static_cast<std::uint32_t>(127 - level) << 23);
  const float fine_u = (u + 0.5f) * scale - 0.5f;
  const float fine_v = (v + 0.5f) * scale - 0.5f;
  const float fine = levels_[level].bilinear(fine_u, fine_v);
  if (blend == 0) return fine;
  const float coarse = levels_[level + 1].bilinear(0.5f * fine_u - 0.25f, 0.5f * fine_v - 0.25f);
  return fine + blend * (coarse - fine);
}

float Texture::mean() const {
  const std::vector<std::uint8_t>& texels = levels_.front().texels;
  return static_cast<float>(std::accumulate(texels.begin(), texels.end(), 0.0) /
                            static_cast<double>(texels.size()));
}

float Texture::sample(float u, float v, const TexelFootprint& footprint) const {
  const Ellipse<float> e = ellipse_of(footprint.u_x, footprint.u_y, footprint.v_x, footprint.v_y);
  const int probes = std::clamp(static_cast<int>(probes_wanted(e) + 0.7f), 1, kMaxProbes);
  const float width = std::max(e.minor, e.major / static_cast<float>(probes));
  return probe(u, v, probes, width, e.major_u, e.major_v);
}

void Texture::sample(const TexturePoints& points, std::span<float, TexturePoints::kSize> grey) const {
  const Ellipse<Floats> e = ellipse_of(points.u_x, points.u_y, points.v_x, points.v_y);
  Ints probes = __builtin_convertvector(probes_wanted(e) + 0.7f, Ints);
  probes = probes < 1 ? Ints{} + 1 : probes;
  probes = probes > kMaxProbes ? Ints{} + kMaxProbes : probes;
  const Floats width = larger(e.minor, e.major / __builtin_convertvector(probes, Floats));
  for (int k = 0; k < TexturePoints::kSize; ++k)
    grey[static_cast<std::size_t>(k)] =
        probe(points.u[k], points.v[k], probes[k], width[k], e.major_u[k], e.major_v[k]);
}

float Texture::probe(float u, float v, int count, float width, float along_u, float along_v) const {
  int level = 0;
  float blend = 0;
  if (width > 1) {
    const float lod = coarse_log2(width);
    level = static_cast<int>(lod);
    blend = lod - static_cast<float>(level);
    const int last = static_cast<int>(levels_.size()) - 1;
    if (level >= last) {
      level = last;
      blend = 0;
    }
  }
  if (count == 1) return trilinear(u, v, level, blend);
  constexpr Probes kNumbers{0, 1, 2, 3, 4, 5, 6, 7};
  static_assert(kMaxProbes == 8);
  const float step = 1.0f / static_cast<float>(count);
  const Probes offset = (kNumbers + 0.5f) * step - 0.5f;
  const Probes grey = trilinear(u + offset * along_u, v + offset * along_v, level, blend, count);
  float sum = 0;
  for (int i = 0; i < count; ++i) sum += grey[i];
  return sum * step;
}

}  // namespace twofold::synthetic
