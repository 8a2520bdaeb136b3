#include "imaging/binary_descriptor.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

namespace twofold {
namespace {

constexpr int kDiscRadius = 15;
constexpr double kPatternSigma = 6.0;
constexpr double kPatternRadius = 13.0;
constexpr std::uint32_t kPatternSeed = 20120501;

/// Standard normal by Box and Muller: the standard's distributions differ between libraries, and the pattern
/// must not.
double gaussian(std::mt19937& rng) {
  const double u = (rng() + 1.0) / 4294967297.0;
  const double v = rng() / 4294967296.0;
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v);
}

Vector2 draw_in_disc(std::mt19937& rng) {
  for (;;) {
    // One after the other: compilers evaluate the arguments of a call in any order.
    Vector2 p;
    p.y() = kPatternSigma * gaussian(rng);
    p.x() = kPatternSigma * gaussian(rng);
    if (p.norm() <= kPatternRadius) return p;
  }
}

float centroid_angle(const cv::Mat& image, int u, int v) {
  int m10 = 0;
  int m01 = 0;
  for (int dv = -kDiscRadius; dv <= kDiscRadius; ++dv) {
    const int half = static_cast<int>(std::sqrt(static_cast<double>(kDiscRadius * kDiscRadius - dv * dv)));
    const std::uint8_t* row = image.ptr<std::uint8_t>(v + dv) + u;
    int sum = 0;
    for (int du = -half; du <= half; ++du) {
      sum += row[du];
      m10 += du * row[du];
    }
    m01 += dv * sum;
  }
  const double angle = std::atan2(static_cast<double>(m01), static_cast<double>(m10));
  return static_cast<float>(angle < 0 ? angle + 2 * std::numbers::pi : angle);
}

}  // namespace

bool can_be_described(const ImagePyramid& pyramid, const DescribedCorner& corner) {
  const cv::Mat& image = pyramid.level(corner.level);
  const float scale = std::ldexp(1.0F, -corner.level);
  const float u = (corner.uv.x() + 0.5F) * scale - 0.5F;
  const float v = (corner.uv.y() + 0.5F) * scale - 0.5F;
  return u >= kDescriptorBorder && v >= kDescriptorBorder && u <= image.cols - 1 - kDescriptorBorder &&
         v <= image.rows - 1 - kDescriptorBorder;
}

void find_nearest(std::span<const DescribedCorner> a, std::span<const DescribedCorner> b,
                  std::vector<NearestDescriptor>& of_a, std::vector<NearestDescriptor>& of_b) {
  of_a.assign(a.size(), {});
  of_b.assign(b.size(), {});
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      const int d = hamming_distance(a[i].descriptor, b[j].descriptor);
      of_a[i].offer(static_cast<int>(j), d);
      of_b[j].offer(static_cast<int>(i), d);
    }
  }
}

CornerDescriber::CornerDescriber() {
  std::mt19937 rng(kPatternSeed);
  for (std::size_t i = 0; i < 256; ++i) {
    const Vector2 a = draw_in_disc(rng);
    const Vector2 b = draw_in_disc(rng);
    for (int d = 0; d < kDirections; ++d) {
      const double angle = 2 * std::numbers::pi * d / kDirections;
      const Eigen::Rotation2Dd R(angle);
      const auto round = [](double x) { return static_cast<std::int8_t>(std::lround(x)); };
      const Vector2 ra = R * a;
      const Vector2 rb = R * b;
      patterns_[static_cast<std::size_t>(d)][i] = {round(ra.x()), round(ra.y()), round(rb.x()),
                                                   round(rb.y())};
    }
  }
}

void CornerDescriber::prepare(const ImagePyramid& pyramid) {
  for (std::size_t l = 0; l < smooth_.size(); ++l) {
    filter_.apply(pyramid.level(static_cast<int>(l)), smooth_[l]);
  }
}

void CornerDescriber::describe(const ImagePyramid& pyramid, std::vector<DescribedCorner>& corners) {
  std::array<bool, ImagePyramid::kLevels> smoothed{};
  std::erase_if(corners, [&](DescribedCorner& corner) {
    if (!can_be_described(pyramid, corner)) return true;
    const std::size_t l = corner.level;
    const cv::Mat& image = pyramid.level(corner.level);
    if (!smoothed[l]) {
      filter_.apply(image, smooth_[l]);
      smoothed[l] = true;
    }
    describe_one(image, smooth_[l], corner);
    return false;
  });
}

void CornerDescriber::describe_one(const cv::Mat& image, const cv::Mat& smooth,
                                   DescribedCorner& corner) const {
  const float scale = std::ldexp(1.0F, -corner.level);
  const int u = static_cast<int>(std::lround((corner.uv.x() + 0.5F) * scale - 0.5F));
  const int v = static_cast<int>(std::lround((corner.uv.y() + 0.5F) * scale - 0.5F));
  corner.angle = centroid_angle(image, u, v);
  const double turn = corner.angle / (2 * std::numbers::pi) * kDirections;
  const auto& pattern = patterns_[static_cast<std::size_t>(std::lround(turn)) % kDirections];
  const std::uint8_t* centre = smooth.ptr<std::uint8_t>(v) + u;
  const auto stride = static_cast<std::ptrdiff_t>(smooth.step);
  for (std::size_t word = 0; word < 4; ++word) {
    std::uint64_t bits = 0;
    for (std::size_t b = 0; b < 64; ++b) {
      const Comparison& c = pattern[64 * word + b];
      bits |= static_cast<std::uint64_t>(centre[c.v0 * stride + c.u0] < centre[c.v1 * stride + c.u1]) << b;
    }
    corner.descriptor.bits[word] = bits;
  }
}

}  // namespace twofold
