#include <Eigen/Cholesky>
#include <cmath>

#include "imaging/patch.hpp"

namespace twofold {
namespace {

constexpr float kMaxMove = 2.5F;      // farther from the start is another corner
constexpr float kSettled = 0.01F;     // [px] no more steps needed
constexpr float kGoodEnough = 0.05F;  // [px] last step when iterations ran out

/// Bilinear samples of an 8x8 window whose corner is at uv; false when it leaves the image.
bool sample_window(const cv::Mat& image, const Eigen::Vector2f& uv, float* samples) {
  const int u0 = static_cast<int>(std::floor(uv.x()));
  const int v0 = static_cast<int>(std::floor(uv.y()));
  constexpr int kBefore = Patch::kCentre;
  constexpr int kAfter = Patch::kSize - Patch::kCentre;
  if (u0 < kBefore || v0 < kBefore || u0 + kAfter >= image.cols || v0 + kAfter >= image.rows) return false;
  const float a = uv.x() - static_cast<float>(u0);
  const float b = uv.y() - static_cast<float>(v0);
  const float w00 = (1 - a) * (1 - b);
  const float w01 = a * (1 - b);
  const float w10 = (1 - a) * b;
  const float w11 = a * b;
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  const std::uint8_t* row = image.data + (v0 - kBefore) * stride + (u0 - kBefore);
  for (int r = 0; r < Patch::kSize; ++r, row += stride, samples += Patch::kSize) {
    const std::uint8_t* below = row + stride;
    for (int c = 0; c < Patch::kSize; ++c) {
      samples[c] = w00 * static_cast<float>(row[c]) + w01 * static_cast<float>(row[c + 1]) +
                   w10 * static_cast<float>(below[c]) + w11 * static_cast<float>(below[c + 1]);
    }
  }
  return true;
}

/// Rows of the Jacobian of gain * T(u + du, v + dv) + offset: gradients, template (mean removed), one.
template <int kMotions>
struct Normal {
  static constexpr int kSize = kMotions + 2;
  using Matrix = Eigen::Matrix<float, kSize, kSize>;
  using Vector = Eigen::Matrix<float, kSize, 1>;

  explicit Normal(const Patch& patch) {
    float sum = 0;
    for (const float value : patch.value) sum += value;
    mean = sum / Patch::kArea;
    Matrix H = Matrix::Zero();
    for (int i = 0; i < Patch::kArea; ++i) {
      const Vector j = row(patch, i);
      H.noalias() += j * j.transpose();
    }
    // A patch without gradient along a direction cannot be placed along it; the damping keeps H invertible,
    // and the step small there.
    for (int m = 0; m < kMotions; ++m) H(m, m) += 1e-3F * H(m, m) + 1.0F;
    H(kMotions, kMotions) += 1.0F;
    inverse = H.inverse();
  }
  Vector row(const Patch& patch, int i) const {
    Vector j;
    j(0) = patch.gradient_u[i];
    if constexpr (kMotions == 2) j(1) = patch.gradient_v[i];
    j(kMotions) = patch.value[i] - mean;
    j(kMotions + 1) = 1;
    return j;
  }

  float mean = 0;
  Matrix inverse;
};

/// J^T r and r^T r of the residual I - (gain T + offset), T with its mean removed.
template <int kMotions>
typename Normal<kMotions>::Vector gradient(const Patch& patch, const float* window, float mean, float gain,
                                           float offset, float& squares) {
  float gu = 0;
  float gv = 0;
  float gt = 0;
  float g1 = 0;
  float r2 = 0;
  for (int i = 0; i < Patch::kArea; ++i) {
    const float t = patch.value[i] - mean;
    const float r = window[i] - gain * t - offset;
    gu += patch.gradient_u[i] * r;
    if constexpr (kMotions == 2) gv += patch.gradient_v[i] * r;
    gt += t * r;
    g1 += r;
    r2 += r * r;
  }
  squares = r2;
  if constexpr (kMotions == 2) {
    return {gu, gv, gt, g1};
  } else {
    return {gu, gt, g1};
  }
}

template <int kMotions>
std::optional<AlignmentResult> align(const Patch& patch, const cv::Mat& image, const Eigen::Vector2f& start,
                                     int max_iterations) {
  const Normal<kMotions> normal(patch);
  AlignmentResult result{start, 0};
  alignas(32) float window[Patch::kArea];
  float gain = 1;
  float offset = normal.mean;
  float last_move = 0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    if (!sample_window(image, result.uv, window)) return std::nullopt;
    float squares = 0;
    const auto step =
        (normal.inverse * gradient<kMotions>(patch, window, normal.mean, gain, offset, squares)).eval();
    // Inverse composition: the template's motion is undone in the image, scaled by the gain it was found
    // with.
    Eigen::Vector2f move(step(0) / gain, 0);
    if constexpr (kMotions == 2) move.y() = step(1) / gain;
    result.uv -= move;
    gain += step(kMotions);
    offset += step(kMotions + 1);
    result.rms = std::sqrt(squares / Patch::kArea);
    if (!(gain > 0.3F) || gain > 3.0F || (result.uv - start).cwiseAbs().maxCoeff() > kMaxMove)
      return std::nullopt;
    last_move = move.norm();
    if (last_move < kSettled) return result;
  }
  if (last_move > kGoodEnough) return std::nullopt;
  return result;
}

}  // namespace

std::optional<AlignmentResult> align_patch(const Patch& patch, const cv::Mat& image,
                                           const Eigen::Vector2f& start, int max_iterations) {
  return align<2>(patch, image, start, max_iterations);
}

std::optional<AlignmentResult> align_patch_in_row(const Patch& patch, const cv::Mat& image,
                                                  const Eigen::Vector2f& start, int max_iterations) {
  return align<1>(patch, image, start, max_iterations);
}

}  // namespace twofold
