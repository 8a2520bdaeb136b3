#include "synthetic/image_effects.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "synthetic/random.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kDepthSigma = 1.425e-3;    ///< [m] at 1 m
constexpr double kMaxSlopeShare = 0.04;     ///< of the depth, between neighbouring pixels
constexpr double kSteepest = 3.73;          ///< tan(75 degrees)
constexpr double kSpotProbability = 0.004;  ///< of a 4x4 block without reading
constexpr int kTableBits = 12;

using HalfNormalTable = std::array<float, 1 << kTableBits>;

HalfNormalTable make_half_normal_table() {
  HalfNormalTable table{};
  double square_sum = 0;
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double p = (static_cast<double>(i) + 0.5) / static_cast<double>(table.size());
    double low = -6;
    double high = 6;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (0.5 * std::erfc(-middle * std::sqrt(0.5)) < p ? low : high) = middle;
    }
    table[i] = static_cast<float>(low);
    square_sum += low * low;
  }
  const auto scale = static_cast<float>(std::sqrt(0.5 * static_cast<double>(table.size()) / square_sum));
  for (float& value : table) value *= scale;
  return table;
}

/// Quantiles of the normal distribution at (i + 1/2) / 4096, scaled so that the sum of two has variance 1. A
/// function makes them: the compiler would take seconds to evaluate a lambda, which is constexpr by itself.
const HalfNormalTable& half_normal_table() {
  static const HalfNormalTable kTable = make_half_normal_table();
  return kTable;
}

/// Standard normal number of a random word, from half_normal_table().
float normal(const HalfNormalTable& table, std::uint64_t word) {
  constexpr std::uint64_t kMask = (1 << kTableBits) - 1;
  return table[word & kMask] + table[(word >> 32) & kMask];
}

std::uint64_t image_key(const NoiseKey& key) {
  return mix64(mix64(key.seed) ^ key.stream);
}

}  // namespace

cv::Mat expose(const cv::Mat& intensity, double gain, double sigma, const NoiseKey& key) {
  cv::Mat image(intensity.size(), CV_8UC1);
  const std::uint64_t base = image_key(key);
  const auto g = static_cast<float>(gain);
  const auto s = static_cast<float>(sigma);
  const HalfNormalTable& table = half_normal_table();
  std::uint64_t counter = base;
  for (int y = 0; y < image.rows; ++y) {
    const auto* in = intensity.ptr<float>(y);
    auto* out = image.ptr<std::uint8_t>(y);
    for (int x = 0; x < image.cols; ++x) {
      const float value = g * in[x] + (s > 0 ? s * normal(table, mix64(counter++)) : 0.0f);
      out[x] = static_cast<std::uint8_t>(std::clamp(value + 0.5f, 0.0f, 255.0f));
    }
  }
  return image;
}

cv::Mat sense_depth(const cv::Mat& inverse_depth, const Rig& rig, double noise_scale, const NoiseKey& key) {
  cv::Mat depth = cv::Mat::zeros(inverse_depth.size(), CV_16UC1);
  const std::uint64_t base = image_key(key);
  const std::uint64_t spots = mix64(base);
  const HalfNormalTable& table = half_normal_table();
  const auto at = [&](int y, int x) {
    y = std::clamp(y, 0, depth.rows - 1);
    x = std::clamp(x, 0, depth.cols - 1);
    return static_cast<double>(inverse_depth.at<float>(y, x));
  };
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      const double w = at(y, x);
      if (w <= 0) continue;
      const double z = 1 / w;
      if (z < rig.depth_min || z > rig.depth_max) continue;
      // Inverse depth of a plane is linear in the image: its slope is f |grad w| / w, a jump stands out.
      const double dx = 0.5 * (at(y, x + 1) - at(y, x - 1));
      const double dy = 0.5 * (at(y + 1, x) - at(y - 1, x));
      if (std::hypot(dx * rig.camera.fx, dy * rig.camera.fy) > kSteepest * w) continue;
      if (std::max(std::abs(dx), std::abs(dy)) > kMaxSlopeShare * w) continue;
      const std::uint64_t block =
          (static_cast<std::uint64_t>(y / 4) << 32) | static_cast<std::uint64_t>(x / 4);
      if (unit_interval(mix64(spots ^ block)) < kSpotProbability) continue;
      const std::uint64_t pixel = static_cast<std::uint64_t>(y) * depth.cols + x;
      const double noisy = z + noise_scale * kDepthSigma * z * z * normal(table, mix64(base + pixel));
      depth.at<std::uint16_t>(y, x) =
          static_cast<std::uint16_t>(std::clamp(std::lround(noisy / rig.depth_unit), 0L, 65535L));
    }
  }
  return depth;
}

}  // namespace twofold::synthetic
