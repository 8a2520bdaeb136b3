#include "synthetic/scene.hpp"

#include <algorithm>
#include <opencv2/core.hpp>

namespace twofold::synthetic {

namespace {

HeightField::Between between(float at, double origin, double spacing, int samples) {
  const auto inv = static_cast<float>(1.0 / spacing);
  const float u = std::clamp((at - static_cast<float>(origin)) * inv, 0.0f, static_cast<float>(samples - 1));
  const int first = std::min(static_cast<int>(u), samples - 2);
  return {first, u - static_cast<float>(first)};
}

}  // namespace

HeightField::Between HeightField::columns_at(float x) const {
  return between(x, x0, spacing, heights.cols);
}

HeightField::Between HeightField::rows_at(float y) const {
  return between(y, y0, spacing, heights.rows);
}

float HeightField::height_at(float x, float y) const {
  const auto [i, a] = columns_at(x);
  const auto [j, b] = rows_at(y);
  const auto* p = heights.ptr<float>(j) + i;
  const auto* q = heights.ptr<float>(j + 1) + i;
  return (1 - b) * (p[0] + a * (p[1] - p[0])) + b * (q[0] + a * (q[1] - q[0]));
}

int Scene::add(const cv::Mat& canvas) {
  textures.emplace_back(canvas);
  return static_cast<int>(textures.size()) - 1;
}

void Scene::strip_textures() {
  for (Texture& texture : textures) texture = Texture(cv::Mat(2, 2, CV_32FC1, cv::Scalar(texture.mean())));
}

std::vector<Quad> box_quads(const SE3& T_w_o, const Vector3& size, int first_texture) {
  const Matrix3 R = T_w_o.rotation();
  const Vector3 x = R.col(0);
  const Vector3 y = R.col(1);
  const Vector3 z = R.col(2);
  const Vector3 half = 0.5 * size;
  const auto corner = [&](double a, double b, double c) {
    return Vector3(T_w_o * Vector3(a * half.x(), b * half.y(), c * half.z()));
  };
  const int t = first_texture;
  // Light falls from above and a little from one side: faces of one box differ, as in daylight.
  return {{corner(-1, -1, 1), x, -z, size.x(), size.z(), t, 0.92},
          {corner(1, -1, 1), y, -z, size.y(), size.z(), t + 1, 0.82},
          {corner(1, 1, 1), -x, -z, size.x(), size.z(), t + 2, 0.74},
          {corner(-1, 1, 1), -y, -z, size.y(), size.z(), t + 3, 0.86},
          {corner(-1, 1, 1), x, -y, size.x(), size.y(), t + 4, 1.0},
          {corner(-1, -1, -1), x, y, size.x(), size.y(), t + 5, 0.6}};
}

}  // namespace twofold::synthetic
