#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "synthetic/synthetic_sequence.hpp"

namespace twofold::synthetic {
namespace {

double bilinear(const cv::Mat& image, double u, double v) {
  const int x = static_cast<int>(u);
  const int y = static_cast<int>(v);
  const double a = u - x;
  const double b = v - y;
  return (1 - b) * ((1 - a) * image.at<float>(y, x) + a * image.at<float>(y, x + 1)) +
         b * ((1 - a) * image.at<float>(y + 1, x) + a * image.at<float>(y + 1, x + 1));
}

/// Does the patch lie on smooth surfaces, with no depth jump in or next to it?
bool is_smooth(const cv::Mat& inverse_depth, int u, int v, int half) {
  for (int y = v - half; y <= v + half; ++y) {
    for (int x = u - half; x <= u + half; ++x) {
      const float w = inverse_depth.at<float>(y, x);
      if (w <= 0) return false;
      for (const float other : {inverse_depth.at<float>(y, x + 1), inverse_depth.at<float>(y + 1, x)})
        if (std::abs(other - w) > 0.02f * w) return false;
    }
  }
  return true;
}

/// Does it lie on one surface? The inverse depth of a plane is linear in the image; a crease, whose pixels
/// show two surfaces at once, is not.
bool is_flat(const cv::Mat& inverse_depth, int u, int v, int half) {
  for (int y = v - half; y <= v + half; ++y) {
    for (int x = u - half; x <= u + half; ++x) {
      const float w = inverse_depth.at<float>(y, x);
      const float bend_x = inverse_depth.at<float>(y, x - 1) - 2 * w + inverse_depth.at<float>(y, x + 1);
      const float bend_y = inverse_depth.at<float>(y - 1, x) - 2 * w + inverse_depth.at<float>(y + 1, x);
      if (std::max(std::abs(bend_x), std::abs(bend_y)) > 5e-4f * w) return false;
    }
  }
  return true;
}

/// Smoothed a little: linear interpolation of edges one pixel wide would measure the interpolation.
cv::Mat smoothed(const cv::Mat& image) {
  cv::Mat f;
  image.convertTo(f, CV_32F);
  cv::GaussianBlur(f, f, {0, 0}, 1.0);
  return f;
}

class Photometry : public testing::TestWithParam<std::string> {
 protected:
  static SyntheticOptions options() {
    SyntheticOptions o = default_options(GetParam());
    o.noise = 0;
    o.f_error = 0;
    if (o.width < 640) {  // enough pixels to judge by
      o.f *= 640.0 / o.width;
      o.height = o.height * 640 / o.width;
      o.width = 640;
    }
    return o;
  }
};

/// Slides the left patch, warped by the exact depth, along the right image: the best match is where geometry
/// says.
TEST_P(Photometry, DisparityMeasuredByCorrelationIsThatOfTheGeometry) {
  if (options().sensor == SensorKind::kMono) GTEST_SKIP() << "no second camera";
  const SyntheticSequence sequence(options());
  const Rig& rig = sequence.rig();
  constexpr int kHalf = 7;
  std::vector<double> errors;
  // Few of the houses are near enough; little beside the carton has texture.
  const bool is_street = GetParam() == "campus" || GetParam() == "terrace";
  const int frames = is_street ? 9 : GetParam() == "turntable" ? 12 : 3;
  for (int n = 0; n < frames; ++n) {
    const int frame_index = n * sequence.frame_count() / frames;
    const Frame frame = sequence.render(frame_index);
    const cv::Mat inverse_depth = sequence.exact_view(frame_index).inverse_depth;
    const cv::Mat left = smoothed(frame.left);
    const cv::Mat right = smoothed(frame.right);
    for (int v = 20; v < left.rows - 20; v += 22) {
      for (int u = 110; u < left.cols - 20; u += 22) {
        if (!is_smooth(inverse_depth, u, v, kHalf + 2) || !is_flat(inverse_depth, u, v, kHalf + 1)) continue;
        // Weights that fall to the rim: an edge cut by the rim would pull.
        const auto cost = [&](double shift) {
          double sum = 0;
          double weights = 0;
          for (int y = v - kHalf; y <= v + kHalf; ++y) {
            for (int x = u - kHalf; x <= u + kHalf; ++x) {
              const double at = x - rig.camera.fx * rig.baseline * inverse_depth.at<float>(y, x) + shift;
              if (at < 1 || at > left.cols - 2) return -1.0;
              const double d = left.at<float>(y, x) - bilinear(right, at, y);
              const double weight = std::exp(-((x - u) * (x - u) + (y - v) * (y - v)) / (2 * 3.0 * 3.0));
              sum += weight * d * d;
              weights += weight;
            }
          }
          return sum / weights;
        };
        // Symmetric steps cancel the smoothing of the interpolation.
        constexpr double kStep = 0.5;
        const double before = cost(-kStep);
        const double middle = cost(0);
        const double after = cost(kStep);
        if (before < 0 || middle < 0 || after < 0 || middle > 20)
          continue;  // out of the image or hidden on the right
        const double curvature = before - 2 * middle + after;
        if (curvature < 10) continue;  // no texture across
        errors.push_back(0.5 * kStep * (before - after) / curvature);
      }
    }
  }
  ASSERT_GT(errors.size(), 300U);
  double mean = 0;
  for (double& e : errors) {
    mean += e / static_cast<double>(errors.size());
    e = std::abs(e);
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(std::abs(mean), 0.01);
  EXPECT_LT(errors[errors.size() / 2], 0.03);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.1);
}

/// The same surface has the same grey level from another place, through the exact warp.
TEST_P(Photometry, SurfacesLookTheSameFromTwoPlaces) {
  if (GetParam() == "turntable") GTEST_SKIP() << "table and wall stand still before its camera";
  const SyntheticSequence sequence(options());
  const PinholeCamera& camera = sequence.rig().camera;
  // 15 cm a frame, half a metre, 4.5 cm in the courtyard
  const int gap = GetParam() == "descent" ? 4 : GetParam() == "terrace" ? 1 : 12;
  for (const int i : {3, sequence.frame_count() / 2}) {
    const View a = sequence.exact_view(i);
    const View b = sequence.exact_view(i + gap);
    const SE3 T_b_a = sequence.T_w_c(i + gap).inverse() * sequence.T_w_c(i);
    double sum = 0;
    double signed_sum = 0;
    int count = 0;
    for (int v = 4; v < camera.height - 4; v += 2) {
      for (int u = 4; u < camera.width - 4; u += 2) {
        if (!is_smooth(a.inverse_depth, u, v, 2)) continue;
        const Vector3 p_b =
            T_b_a * Vector3(camera.unproject(Vector2(u, v)) / a.inverse_depth.at<float>(v, u));
        if (p_b.z() < 0.1) continue;
        const Vector2 uv = camera.project(p_b);
        if (!camera.contains(uv, 4)) continue;
        const int x = static_cast<int>(std::lround(uv.x()));
        const int y = static_cast<int>(std::lround(uv.y()));
        if (!is_smooth(b.inverse_depth, x, y, 2)) continue;
        if (std::abs(b.inverse_depth.at<float>(y, x) * p_b.z() - 1) > 0.02) continue;  // hidden in b
        const double d = bilinear(b.intensity, uv.x(), uv.y()) - a.intensity.at<float>(v, u);
        sum += std::abs(d);
        signed_sum += d;
        ++count;
      }
    }
    ASSERT_GT(count, 10000);
    EXPECT_LT(sum / count, 3.5);  // what resampling and a change of scale leave
    EXPECT_LT(std::abs(signed_sum / count), 0.15);
  }
}

/// The room's depth in the upper corners of the image tells whether the camera moves through it.
TEST(TurntableScene, CameraOrThingMovesAsItIsTold) {
  for (const int motion : {0, 1, 2}) {
    SCOPED_TRACE(motion);
    SyntheticOptions options = default_options("turntable");
    options.motion = motion;
    const SyntheticSequence sequence(options);
    constexpr int kLater = 100;
    const SE3 T_then_now = sequence.T_w_c(kLater).inverse() * sequence.T_w_c(0);
    EXPECT_GT(T_then_now.so3().log().norm(), 0.5) << "the thing is seen from another side";
    const cv::Mat before = sequence.exact_view(0).inverse_depth;
    const cv::Mat after = sequence.exact_view(kLater).inverse_depth;
    double change = 0;
    for (const int u : {5, before.cols - 6})
      change = std::max<double>(change, std::abs(before.at<float>(5, u) - after.at<float>(5, u)));
    if (motion == 1) {
      EXPECT_GT(change, 0.01);
    } else {
      EXPECT_LT(change, 1e-5);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, Photometry, testing::ValuesIn(scene_names()));

TEST(RgbdSequence, DepthImageIsTheGeometryUpToItsUnit) {
  SyntheticOptions options = default_options("desk");
  options.sensor = SensorKind::kRgbd;
  options.depth_noise = 0;
  const SyntheticSequence sequence(options);
  const Frame frame = sequence.render(100);
  EXPECT_TRUE(frame.right.empty());
  const cv::Mat inverse_depth = sequence.exact_view(100).inverse_depth;
  int readings = 0;
  for (int v = 0; v < frame.depth.rows; ++v) {
    for (int u = 0; u < frame.depth.cols; ++u) {
      const int reading = frame.depth.at<std::uint16_t>(v, u);
      if (reading == 0) continue;
      ++readings;
      ASSERT_NEAR(reading * sequence.rig().depth_unit, 1 / inverse_depth.at<float>(v, u), 0.00051);
    }
  }
  EXPECT_GT(readings, 0.85 * frame.depth.total());
}

}  // namespace
}  // namespace twofold::synthetic
