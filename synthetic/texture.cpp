#include "synthetic/texture.hpp"

#ifdef __AVX__
#include <immintrin.h>
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include "base/check.hpp"

namespace twofold::synthetic {
namespace {

using Floats = TexturePoints::Floats;
using Ints = std::int32_t __attribute__((vector_size(sizeof(Floats))));

/// log2 of positive normal numbers, exact at powers of two and linear between them (error < 0.09): enough to
/// blend two pyramid levels, and the same on every machine.
Floats coarse_log2(Floats x) {
  const auto bits = std::bit_cast<Ints>(x);
  const Ints exponent = (bits >> 23) - 127;
  const auto mantissa = std::bit_cast<Floats>((bits & 0x007fffff) | 0x3f800000);
  return __builtin_convertvector(exponent, Floats) + (mantissa - 1.0f);
}

/// Four bytes each from `base` + `at`, the first in the lowest bits.
Ints gather(const void* base, Ints at) {
#ifdef __AVX2__
  return std::bit_cast<Ints>(
      _mm256_i32gather_epi32(static_cast<const int*>(base), std::bit_cast<__m256i>(at), 1));
#else
  Ints words;
  for (int k = 0; k < TexturePoints::kSize; ++k) {
    std::int32_t word = 0;
    std::memcpy(&word, static_cast<const std::uint8_t*>(base) + at[k], sizeof word);
    words[k] = word;
  }
  return words;
#endif
}

Floats larger(Floats a, Floats b) {
  return a < b ? b : a;
}
Floats magnitude(Floats x) {
  return x < 0.0f ? -x : x;
}
Floats root(Floats x) {
#ifdef __AVX__
  return _mm256_sqrt_ps(x);
#else
  for (int k = 0; k < TexturePoints::kSize; ++k) x[k] = std::sqrt(x[k]);
  return x;
#endif
}

bool none(Ints mask) {
  std::int32_t any = 0;
  for (int k = 0; k < TexturePoints::kSize; ++k) any |= mask[k];
  return any == 0;
}

struct Ellipse {
  Floats major, minor;      ///< lengths of the axes [texel/px]
  Floats major_u, major_v;  ///< the major axis itself [texel/px]
};

/// Image of the unit circle of a pixel: singular values and first left singular vector of the 2x2 footprint.
Ellipse ellipse_of(const TexturePoints& p) {
  const Floats uu = p.u_x * p.u_x + p.u_y * p.u_y;
  const Floats vv = p.v_x * p.v_x + p.v_y * p.v_y;
  const Floats uv = p.u_x * p.v_x + p.u_y * p.v_y;
  const Floats difference = uu - vv;
  const Floats largest = 0.5f * (uu + vv + root(difference * difference + 4 * uv * uv));
  const Floats determinant = magnitude(p.u_x * p.v_y - p.u_y * p.v_x);
  Ellipse e;
  e.major = root(largest) + 1e-6f;
  e.minor = determinant / e.major;
  // Of the two equivalent eigenvector formulas, the one without cancellation.
  const Floats a_u = difference >= 0 ? largest - vv : uv;
  const Floats a_v = difference >= 0 ? uv : largest - uu;
  const Floats norm = root(a_u * a_u + a_v * a_v);
  const Floats scale = norm > 1e-12f ? e.major / norm : Floats{};
  e.major_u = a_u * scale;
  e.major_v = a_v * scale;
  return e;
}

/// How much longer the ellipse is than a probe may be wide.
Floats probes_wanted(const Ellipse& e) {
  return e.major /
         larger(larger(e.minor, Floats{} + 1.0f), e.major / static_cast<float>(Texture::kMaxProbes));
}

}  // namespace

Texture::Texture(const cv::Mat& canvas) {
  TWOFOLD_CHECK(canvas.type() == CV_32FC1 && canvas.cols >= 2 && canvas.rows >= 2, "texture canvas");
  int width = canvas.cols, height = canvas.rows;
  texels_.reserve(static_cast<std::size_t>(width) * height * 4 / 3 + 64);
  const auto add_level = [&] {
    widths_.push_back(width);
    heights_.push_back(height);
    starts_.push_back(static_cast<std::int32_t>(texels_.size()));
    texels_.resize(texels_.size() + static_cast<std::size_t>(width) * height);
    return texels_.data() + starts_.back();
  };
  auto* out = add_level();
  for (int y = 0; y < height; ++y) {
    const auto* row = canvas.ptr<float>(y);
    for (int x = 0; x < width; ++x)
      *out++ = static_cast<std::uint8_t>(std::clamp(row[x], 0.0f, 255.0f) + 0.5f);
  }
  while (width >= 4 && height >= 4) {
    const int fine_width = width;
    const std::int32_t fine = starts_.back();
    width /= 2;
    height /= 2;
    out = add_level();
    for (int y = 0; y < height; ++y) {
      const auto* above = texels_.data() + fine + static_cast<std::size_t>(2 * y) * fine_width;
      const auto* below = above + fine_width;
      for (int x = 0; x < width; ++x) {
        const int sum = above[2 * x] + above[2 * x + 1] + below[2 * x] + below[2 * x + 1];
        // Ties alternate so that rounding does not brighten the pyramid from level to level.
        *out++ = static_cast<std::uint8_t>((sum + 1 + ((x + y) & 1)) >> 2);
      }
    }
  }
  texels_.resize(texels_.size() + 3);
}

Floats Texture::bilinear(Floats u, Floats v, Ints level) const {
  const Ints width = gather(widths_.data(), 4 * level), height = gather(heights_.data(), 4 * level);
  const Floats last_u = __builtin_convertvector(width - 1, Floats),
               last_v = __builtin_convertvector(height - 1, Floats);
  u = u > 0.0f ? u : Floats{};
  v = v > 0.0f ? v : Floats{};
  u = u < last_u ? u : last_u;
  v = v < last_v ? v : last_v;
  Ints x = __builtin_convertvector(u, Ints), y = __builtin_convertvector(v, Ints);
  x = x < width - 2 ? x : width - 2;
  y = y < height - 2 ? y : height - 2;
  const Floats a = u - __builtin_convertvector(x, Floats);
  const Floats b = v - __builtin_convertvector(y, Floats);
  const Ints at = gather(starts_.data(), 4 * level) + y * width + x;
  const Ints upper = gather(texels_.data(), at), lower = gather(texels_.data(), at + width);
  const Ints p0 = upper & 255, p1 = (upper >> 8) & 255;
  const Ints q0 = lower & 255, q1 = (lower >> 8) & 255;
  const Floats top = __builtin_convertvector(p0, Floats) + a * __builtin_convertvector(p1 - p0, Floats);
  const Floats bottom = __builtin_convertvector(q0, Floats) + a * __builtin_convertvector(q1 - q0, Floats);
  return top + b * (bottom - top);
}

Floats Texture::trilinear(Floats u, Floats v, const Detail& detail) const {
  // Texel i of level l covers base texels [2^l (i + 0.5) - 0.5 -+ 2^l / 2].
  const auto scale = std::bit_cast<Floats>((127 - detail.level) << 23);
  const Floats fine_u = (u + 0.5f) * scale - 0.5f;
  const Floats fine_v = (v + 0.5f) * scale - 0.5f;
  const Floats fine = bilinear(fine_u, fine_v, detail.level);
  if (none(detail.blend != 0)) return fine;
  const auto last = static_cast<std::int32_t>(widths_.size()) - 1;
  const Ints next = detail.level < last ? detail.level + 1 : detail.level;
  const Floats coarse = bilinear(0.5f * fine_u - 0.25f, 0.5f * fine_v - 0.25f, next);
  return fine + detail.blend * (coarse - fine);
}

Texture::Detail Texture::detail_of(Floats width) const {
  const Floats lod = width > 1.0f ? coarse_log2(width) : Floats{};
  const Ints level = __builtin_convertvector(lod, Ints);
  const auto last = static_cast<std::int32_t>(widths_.size()) - 1;
  return {level < last ? level : Ints{} + last,
          level < last ? lod - __builtin_convertvector(level, Floats) : Floats{}};
}

float Texture::mean() const {
  const auto first = texels_.begin(), last = first + static_cast<std::ptrdiff_t>(width()) * height();
  return static_cast<float>(std::accumulate(first, last, 0.0) / static_cast<double>(last - first));
}

Floats Texture::sample(const TexturePoints& points) const {
  const Ellipse e = ellipse_of(points);
  Ints probes = __builtin_convertvector(probes_wanted(e) + 0.7f, Ints);
  probes = probes < 1 ? Ints{} + 1 : probes;
  probes = probes > kMaxProbes ? Ints{} + kMaxProbes : probes;
  const Floats count = __builtin_convertvector(probes, Floats);
  const Detail detail = detail_of(larger(e.minor, e.major / count));
  const Floats step = 1.0f / count;
  Floats sum{};
  for (int i = 0; !none(probes > i); ++i) {
    const Floats offset = (static_cast<float>(i) + 0.5f) * step - 0.5f;
    const Floats probe = trilinear(points.u + offset * e.major_u, points.v + offset * e.major_v, detail);
    sum += probes > i ? probe : Floats{};
  }
  return sum * step;
}

}  // namespace twofold::synthetic
