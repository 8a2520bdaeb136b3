#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "synthetic/furniture.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/scenes.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kWidth = 6.0;  ///< of the surface [m]; 25 degrees see 4.4 m from 10 m
constexpr double kDescentDepth = 5.0;
constexpr double kDescentTexel = 0.0008;
constexpr double kDescentSpacing = 0.008;  ///< of the height samples
constexpr double kDescentSpeed = 1.5;      ///< 15 cm a frame at 10 frames a second
constexpr double kTopHeight = 10.0;
constexpr double kLastHeight = 1.0;

void dig_crater(cv::Mat& heights, double x, double y, double radius) {
  const int reach = static_cast<int>(2.2 * radius / kDescentSpacing) + 1;
  const int cx = static_cast<int>(x / kDescentSpacing);
  const int cy = static_cast<int>(y / kDescentSpacing);
  for (int j = std::max(0, cy - reach); j <= std::min(heights.rows - 1, cy + reach); ++j) {
    for (int i = std::max(0, cx - reach); i <= std::min(heights.cols - 1, cx + reach); ++i) {
      const double r = std::hypot(i * kDescentSpacing - x, j * kDescentSpacing - y) / radius;
      // A bowl with a raised rim that fades outwards; slopes stay below 0.6.
      const double bowl = -0.22 * std::exp(-2.2 * r * r);
      const double rim = 0.10 * std::exp(-9 * (r - 1) * (r - 1));
      heights.at<float>(j, i) += static_cast<float>(radius * (bowl + rim));
    }
  }
}

cv::Mat make_heights(Random& random) {
  Canvas relief(kWidth, kDescentDepth, kDescentSpacing, 0);
  relief.add_noise(random.word(), 0.06f, 2.0, 0.08, 0.45f);
  cv::Mat heights = relief.image();
  for (int i = 0; i < 240; ++i) {
    const double radius = 0.03 * std::pow(0.45 / 0.03, std::pow(random.uniform(0, 1), 2.5));
    const double y = random.uniform(0, kDescentDepth);
    dig_crater(heights, random.uniform(0, kWidth), y, radius);
  }
  return heights;
}

/// Heights along one row of samples, at every texel's x and one spacing to either side of it.
struct Profile {
  int row = -1;
  std::vector<float> left, here, right;
};

/// Profiles of the rows around the texels that are being lit: a row of samples lasts for ten rows of texels.
class Profiles {
 public:
  Profiles(const HeightField& ground, int texels) : ground_(ground) {
    const auto h = static_cast<float>(kDescentSpacing);
    for (int i = 0; i < texels; ++i) {
      const auto x = static_cast<float>((i + 0.5) * kDescentTexel + ground.x0);
      left_.push_back(ground.columns_at(x - h));
      here_.push_back(ground.columns_at(x));
      right_.push_back(ground.columns_at(x + h));
    }
  }

  const Profile& operator[](int row) {
    Profile& profile = kept_[static_cast<std::size_t>(row) % kept_.size()];
    if (profile.row != row) {
      profile.row = row;
      const auto* heights = ground_.heights.ptr<float>(row);
      fill(profile.left, left_, heights);
      fill(profile.here, here_, heights);
      fill(profile.right, right_, heights);
    }
    return profile;
  }

 private:
  static void fill(std::vector<float>& profile, const std::vector<HeightField::Between>& at,
                   const float* heights) {
    profile.resize(at.size());
    for (std::size_t i = 0; i < at.size(); ++i) {
      const float* p = heights + at[i].first;
      profile[i] = p[0] + at[i].weight * (p[1] - p[0]);
    }
  }

  const HeightField& ground_;
  std::vector<HeightField::Between> left_, here_, right_;
  std::array<Profile, 8> kept_;  ///< more than one row of texels looks at
};

/// Albedo times the light of a low sun on the slope.
void light(Canvas& canvas, const HeightField& ground) {
  const Vector3 sun = Vector3(-0.62, 0.4, 0.68).normalized();
  cv::Mat& image = canvas.image();
  const auto h = static_cast<float>(kDescentSpacing);
  Profiles profiles(ground, image.cols);
  for (int j = 0; j < image.rows; ++j) {
    const auto y = static_cast<float>((j + 0.5) * kDescentTexel + ground.y0);
    const auto [a, a_weight] = ground.rows_at(y - h);
    const auto [b, b_weight] = ground.rows_at(y);
    const auto [c, c_weight] = ground.rows_at(y + h);
    const Profile &a0 = profiles[a], &a1 = profiles[a + 1], &b0 = profiles[b], &b1 = profiles[b + 1],
                  &c0 = profiles[c], &c1 = profiles[c + 1];
    const auto mix = [](float weight, float first, float second) {
      return (1 - weight) * first + weight * second;
    };
    auto* grey = image.ptr<float>(j);
    for (std::size_t i = 0; i < a0.here.size(); ++i) {
      const float sx =
          (mix(b_weight, b0.right[i], b1.right[i]) - mix(b_weight, b0.left[i], b1.left[i])) / (2 * h);
      const float sy =
          (mix(c_weight, c0.here[i], c1.here[i]) - mix(a_weight, a0.here[i], a1.here[i])) / (2 * h);
      const auto lambert =
          static_cast<float>(-sx * sun.x() - sy * sun.y() + sun.z()) / std::sqrt(sx * sx + sy * sy + 1);
      grey[i] *= std::max(0.12f, 0.15f + 1.25f * lambert);
    }
  }
}

}  // namespace

Staging make_descent(std::uint64_t seed) {
  Staging staging;
  Random random(mix64(seed) ^ 0x64657363ULL);
  HeightField ground{-0.5 * kWidth, -0.5 * kDescentDepth, kDescentSpacing, make_heights(random), 0};

  Canvas soil(kWidth, kDescentDepth, kDescentTexel, 125);
  soil.add_noise(random.word(), 26, 1.5, 0.002, 0.85f);
  scatter_specks(soil, random, 900, 0.003, 0.03, 45);  // pebbles
  light(soil, ground);
  ground.texture = staging.scene.add(soil.finish());
  staging.scene.height_fields.push_back(std::move(ground));

  constexpr double kSeconds = (kTopHeight - kLastHeight) / kDescentSpeed;
  staging.round_seconds = kSeconds + 0.1;  // 61 frames: the first and the last height included
  staging.path = [](double t) {
    const double phase = std::fmod(t, 2 * kSeconds);  // down, then up again
    const double z = kTopHeight - kDescentSpeed * (phase <= kSeconds ? phase : 2 * kSeconds - phase);
    // Optical axis down, x of the image along world x, with a little sway.
    Matrix3 R_w_c;
    R_w_c << 1, 0, 0, 0, -1, 0, 0, 0, -1;
    const SO3 sway =
        SO3::exp(Vector3(0.010 * std::sin(1.1 * t), 0.012 * std::sin(0.8 * t), 0.05 * std::sin(0.4 * t)));
    return SE3(SO3(R_w_c) * sway, Vector3(0.05 * std::sin(0.7 * t), 0.04 * std::sin(0.9 * t), z));
  };
  staging.object_size = {0.12, 0.08, 0.05};  // a rover
  staging.object_texture = add_box_textures(staging.scene, staging.object_size, 0.0008,
                                            [&](Canvas& c) { paint_metal(c, random, 150); });
  staging.T_w_object = [](double t) { return standing(0.12 * t - 0.4, 0.1 * std::sin(t), 0.08, 0.3); };
  return staging;
}

}  // namespace twofold::synthetic
