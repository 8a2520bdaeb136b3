#include <Eigen/LU>
#include <cmath>
#include <cstring>

#include "imaging/patch.hpp"
#include "imaging/pixel_row.hpp"

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
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  const std::uint8_t* pixels = image.data + (v0 - kBefore) * stride + (u0 - kBefore);
  const auto between_columns = [&] { return (1 - a) * load_floats(pixels) + a * load_floats(pixels + 1); };
  static_assert(Patch::kSize == 8);
  Floats8 above = between_columns();
  for (int r = 0; r < Patch::kSize; ++r, samples += Patch::kSize) {
    pixels += stride;
    const Floats8 below = between_columns();
    const Floats8 between_rows = (1 - b) * above + b * below;
    std::memcpy(samples, &between_rows, sizeof between_rows);
    above = below;
  }
  return true;
}

using Pixels = Eigen::Array<float, Patch::kArea, 1>;
using PixelsView = Eigen::Map<const Pixels, Eigen::Aligned32>;

/// Least squares for the residual I - (gain T + offset), T with its mean removed. A row of the Jacobian is
/// the gradients of the template, T and 1.
template <int kMotions>
struct PatchEquations {
  static constexpr int kSize = kMotions + 2;
  using Matrix = Eigen::Matrix<float, kSize, kSize>;
  using Vector = Eigen::Matrix<float, kSize, 1>;

  explicit PatchEquations(const Patch& patch) : gu(patch.gradient_u), gv(patch.gradient_v) {
    const PixelsView value(patch.value);
    mean = value.sum() / Patch::kArea;
    t = value - mean;
    Matrix H;
    // Upper triangle; T and 1 are orthogonal because T has no mean.
    H(0, 0) = (gu * gu).sum();
    if constexpr (kMotions == 2) {
      H(0, 1) = H(1, 0) = (gu * gv).sum();
      H(1, 1) = (gv * gv).sum();
      H(1, 2) = H(2, 1) = (gv * t).sum();
      H(1, 3) = H(3, 1) = gv.sum();
    }
    constexpr int kT = kMotions;
    H(0, kT) = H(kT, 0) = (gu * t).sum();
    H(0, kT + 1) = H(kT + 1, 0) = gu.sum();
    H(kT, kT) = t.square().sum() + 1.0F;
    H(kT, kT + 1) = H(kT + 1, kT) = 0;
    H(kT + 1, kT + 1) = Patch::kArea;
    // A patch without gradient along a direction cannot be placed along it; the damping keeps H invertible,
    // and the step small there.
    for (int m = 0; m < kMotions; ++m) H(m, m) += 1e-3F * H(m, m) + 1.0F;
    inverse = H.inverse();
  }

  /// Step of (u, v, gain, offset), and the sum of squares it starts from.
  Vector step(const PixelsView& window, float gain, float offset, float& squares) const {
    const Pixels r = window - gain * t - offset;
    squares = r.square().sum();
    Vector g;
    g(0) = (gu * r).sum();
    if constexpr (kMotions == 2) g(1) = (gv * r).sum();
    g(kMotions) = (t * r).sum();
    g(kMotions + 1) = r.sum();
    return inverse * g;
  }

  PixelsView gu, gv;
  Pixels t;
  float mean = 0;
  Matrix inverse;
};

template <int kMotions>
std::optional<AlignmentResult> align(const Patch& patch, const cv::Mat& image, const Eigen::Vector2f& start,
                                     int max_iterations) {
  const PatchEquations<kMotions> equations(patch);
  AlignmentResult result{start, 0};
  alignas(32) float window[Patch::kArea];
  float gain = 1;
  float offset = equations.mean;
  float last_move = 0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    if (!sample_window(image, result.uv, window)) return std::nullopt;
    float squares = 0;
    const auto step = equations.step(PixelsView(window), gain, offset, squares);
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
