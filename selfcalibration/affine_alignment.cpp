#include "selfcalibration/affine_alignment.hpp"

#include <Eigen/LU>
#include <cmath>

#include "geometry/symmetric_solve.hpp"

namespace twofold {
namespace {

constexpr int kRadius = 6;  // of the part of a patch that is compared
constexpr int kAlignmentSteps = 20;
constexpr float kSettledStep = 0.005F;   // [px]
constexpr float kFarthestMove = 3;       // [px] from where the search began
constexpr double kMinCorrelation = 0.9;  // of what is compared
constexpr float kMinScale = 0.4F, kMaxScale = 2.5F;

/// Bilinear value and derivative. The place must be a pixel away from the border.
struct Sample {
  double value = 0, du = 0, dv = 0;
};

Sample sample(const cv::Mat& image, const Eigen::Vector2f& at) {
  const int u = static_cast<int>(at.x()), v = static_cast<int>(at.y());
  const double a = at.x() - static_cast<float>(u), b = at.y() - static_cast<float>(v);
  const auto pixel = [&](int x, int y) { return static_cast<double>(image.ptr<std::uint8_t>(y)[x]); };
  const auto bilinear = [&](int x, int y) {
    return (1 - b) * ((1 - a) * pixel(x, y) + a * pixel(x + 1, y)) +
           b * ((1 - a) * pixel(x, y + 1) + a * pixel(x + 1, y + 1));
  };
  return {bilinear(u, v), 0.5 * (bilinear(u + 1, v) - bilinear(u - 1, v)),
          0.5 * (bilinear(u, v + 1) - bilinear(u, v - 1))};
}

bool stays_inside(const AffineMatch& match, const cv::Mat& image) {
  const float reach = kRadius * (match.A.cwiseAbs().rowwise().sum()).maxCoeff() + 2;
  return match.centre.x() > reach && match.centre.y() > reach &&
         match.centre.x() < static_cast<float>(image.cols - 1) - reach &&
         match.centre.y() < static_cast<float>(image.rows - 1) - reach;
}

/// Sums over the patch.
struct AffineEquations {
  Matrix8 H = Matrix8::Zero();
  Vector8 g = Vector8::Zero();
  double n = 0, t = 0, i = 0, tt = 0, ii = 0, ti = 0;  ///< of patch and image values, for their correlation

  [[nodiscard]] double correlation() const {
    const double covariance = ti - t * i / n;
    return covariance / std::sqrt(std::max(1e-9, (tt - t * t / n) * (ii - i * i / n)));
  }
};

AffineEquations equations_at(const PointAppearance& appearance, const cv::Mat& image,
                             const AffineMatch& match, double gain, double offset) {
  AffineEquations sums;
  for (int y = -kRadius; y <= kRadius; ++y) {
    for (int x = -kRadius; x <= kRadius; ++x) {
      const auto at = static_cast<std::size_t>((y + PointAppearance::kCentre) * PointAppearance::kSize + x +
                                               PointAppearance::kCentre);
      const double t = appearance.pixels[at];
      const Eigen::Vector2f place =
          match.A * Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y)) + match.centre;
      const Sample s = sample(image, place);
      const Vector8 J = (Vector8() << s.du * x, s.du * y, s.dv * x, s.dv * y, s.du, s.dv, -t, -1).finished();
      sums.H.selfadjointView<Eigen::Lower>().rankUpdate(J);
      sums.g -= J * (s.value - gain * t - offset);
      sums.n += 1;
      sums.t += t;
      sums.i += s.value;
      sums.tt += t * t;
      sums.ii += s.value * s.value;
      sums.ti += t * s.value;
    }
  }
  return sums;
}

}  // namespace

bool align_affine(const PointAppearance& appearance, const cv::Mat& image, AffineMatch& match) {
  AffineMatch now = match;
  double gain = 1, offset = 0;
  for (int iteration = 0; iteration < kAlignmentSteps; ++iteration) {
    if (!stays_inside(now, image)) return false;
    AffineEquations sums = equations_at(appearance, image, now, gain, offset);
    sums.H.diagonal() *= 1 + 1e-6;
    const Vector8 step = solve_symmetric(sums.H, sums.g);
    if (!step.allFinite()) return false;
    now.A(0, 0) += static_cast<float>(step[0]);
    now.A(0, 1) += static_cast<float>(step[1]);
    now.A(1, 0) += static_cast<float>(step[2]);
    now.A(1, 1) += static_cast<float>(step[3]);
    now.centre += step.segment<2>(4).cast<float>();
    gain += step[6];
    offset += step[7];
    const float scale = now.A.determinant();
    if (!((now.centre - match.centre).norm() < kFarthestMove) || !(scale > kMinScale) || !(scale < kMaxScale))
      return false;
    if (step.segment<2>(4).norm() > kSettledStep) continue;
    if (sums.correlation() < kMinCorrelation) return false;
    match = now;
    return true;
  }
  return false;
}

}  // namespace twofold
