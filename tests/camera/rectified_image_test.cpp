#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "camera/rectifier.hpp"
#include "tests/camera/example_rigs.hpp"

namespace twofold {
namespace {

/// A smooth pattern on a plane, imaged by a raw camera.
cv::Mat image_of_plane(const CameraModel& camera, const SE3& T_c_w, double phase_per_metre) {
  cv::Mat image(camera.pinhole.height, camera.pinhole.width, CV_8UC1);
  const SE3 T_w_c = T_c_w.inverse();
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const Vector3 ray = T_w_c.so3() * *camera.unproject(Vector2(u, v));
      const double depth = (4 - T_w_c.translation().z()) / ray.z();  // plane z = 4 of the world
      const Vector3 x_w = T_w_c.translation() + depth * ray;
      const double s = std::sin(phase_per_metre * x_w.x()) * std::cos(0.8 * phase_per_metre * x_w.y());
      image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(128 + 100 * s);
    }
  }
  return image;
}

TEST(Rectifier, RectifiedImagesShowTheSamePointAtTheDisparityOfItsDepth) {
  const Calibration c = euroc();
  const Rectifier rectifier(c);
  Frame raw{3, 77, image_of_plane(c.left, SE3(), 4), image_of_plane(c.right, c.T_right_left, 4), {}};
  ASSERT_EQ(rectifier.mismatch_reason(raw), "");
  Frame out;
  rectifier.rectify(raw, out);
  EXPECT_EQ(out.index, 3);
  EXPECT_EQ(out.t_ns, 77);
  const Rig& rig = rectifier.rig();
  const Vector3 normal = rectifier.R_rectified_left() * Vector3::UnitZ();
  double sum = 0;
  int count = 0;
  for (int v = 10; v < rig.camera.height - 10; v += 9) {
    for (int u = 80; u < rig.camera.width - 10; u += 9) {
      const Vector3 ray = rig.camera.unproject(Vector2(u, v));
      const Vector3 z = rig.project(ray * (4 / normal.dot(ray)));
      cv::Mat value;
      cv::getRectSubPix(out.right, {1, 1}, cv::Point2f(z.z(), z.y()), value);
      sum += std::abs(value.at<std::uint8_t>(0, 0) - out.left.at<std::uint8_t>(v, u));
      ++count;
    }
  }
  EXPECT_LT(sum / count, 0.8);  // grey levels; rounding alone gives about 0.5
}

}  // namespace
}  // namespace twofold
