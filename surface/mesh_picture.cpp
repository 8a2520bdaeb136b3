#include "surface/mesh_picture.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "base/check.hpp"

namespace twofold {
namespace {

constexpr double kNearest = 0.02;  // [m]; triangles that reach nearer are left out

/// Which triangle is nearest, pixel by pixel.
class Raster {
 public:
  explicit Raster(const PinholeCamera& camera)
      : inverse_depth(camera.height, camera.width, CV_32FC1, cv::Scalar(0)) {}

  /// Corners as (u, v, 1/z). Calls visible(y, x, a, b, c) where the triangle is the nearest so far, with the
  /// corners' shares.
  template <class Visible>
  void triangle(const std::array<Eigen::Vector3f, 3>& p, Visible visible) {
    const auto cross = [](const Eigen::Vector3f& o, const Eigen::Vector3f& a, float u, float v) {
      return (a.x() - o.x()) * (v - o.y()) - (a.y() - o.y()) * (u - o.x());
    };
    const float area = cross(p[0], p[1], p[2].x(), p[2].y());
    if (area >= 0) return;  // v points down: seen from outside, corners go round the other way
    const auto range = [](float a, float b, float c, int size) {
      return std::pair{std::max(0, static_cast<int>(std::ceil(std::min({a, b, c})))),
                       std::min(size - 1, static_cast<int>(std::floor(std::max({a, b, c}))))};
    };
    const auto [left, right] = range(p[0].x(), p[1].x(), p[2].x(), inverse_depth.cols);
    const auto [top, bottom] = range(p[0].y(), p[1].y(), p[2].y(), inverse_depth.rows);
    for (int y = top; y <= bottom; ++y)
      for (int x = left; x <= right; ++x) {
        const auto u = static_cast<float>(x);
        const auto v = static_cast<float>(y);
        const float a = cross(p[1], p[2], u, v) / area;
        const float b = cross(p[2], p[0], u, v) / area;
        const float c = 1 - a - b;
        if (a < 0 || b < 0 || c < 0) continue;
        const float w = a * p[0].z() + b * p[1].z() + c * p[2].z();
        auto& before = inverse_depth.at<float>(y, x);
        if (w <= before) continue;
        before = w;
        visible(y, x, a, b, c);
      }
  }

  cv::Mat inverse_depth;  ///< [1/m]; 0: nothing
};

/// Vertices as (u, v, 1/z) in the picture; 1/z is 0 where they are too near or behind.
std::vector<Eigen::Vector3f> corners_in(const PictureView& view, const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3f> corners(mesh.positions.size(), Eigen::Vector3f::Zero());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vector3 x_c = view.T_c_w * Vector3(mesh.positions[v].cast<double>());
    if (x_c.z() <= kNearest) continue;
    const Vector2 uv = view.camera.project(x_c);
    corners[v] = {static_cast<float>(uv.x()), static_cast<float>(uv.y()), static_cast<float>(1 / x_c.z())};
  }
  return corners;
}

template <class Visible>
void draw_triangles(const TriangleMesh& mesh, const std::vector<Eigen::Vector3f>& corners, Raster& raster,
                    Visible visible) {
  for (const auto& t : mesh.triangles) {
    if (corners[t[0]].z() <= 0 || corners[t[1]].z() <= 0 || corners[t[2]].z() <= 0) continue;
    raster.triangle({corners[t[0]], corners[t[1]], corners[t[2]]},
                    [&](int y, int x, float a, float b, float c) { visible(t, y, x, a, b, c); });
  }
}

}  // namespace

cv::Mat draw_mesh(const TriangleMesh& mesh, std::span<const Rgb> colours, const PictureView& view) {
  TWOFOLD_CHECK(mesh.normals.size() == mesh.positions.size(), "a mesh with normals");
  const Eigen::Matrix3f R_c_w = view.T_c_w.rotation().cast<float>();
  const Eigen::Vector3f light = Eigen::Vector3f(0.4f, -0.6f, -1.0f).normalized();
  std::vector<Eigen::Vector3f> shades(mesh.positions.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const float lit = 0.35f + 0.65f * std::max(0.0f, (R_c_w * mesh.normals[v]).dot(light));
    shades[v] = colours.empty() ? Eigen::Vector3f::Constant(235 * lit)
                                : Eigen::Vector3f(colours[v][0], colours[v][1], colours[v][2]);
  }
  cv::Mat image(view.camera.height, view.camera.width, CV_8UC3, cv::Scalar(255, 255, 255));
  Raster raster(view.camera);
  draw_triangles(mesh, corners_in(view, mesh), raster,
                 [&](const auto& t, int y, int x, float a, float b, float c) {
                   const Eigen::Vector3f mixed = a * shades[t[0]] + b * shades[t[1]] + c * shades[t[2]];
                   image.at<cv::Vec3b>(y, x) = {static_cast<std::uint8_t>(mixed.z()),
                                                static_cast<std::uint8_t>(mixed.y()),
                                                static_cast<std::uint8_t>(mixed.x())};
                 });
  return image;
}

cv::Mat depth_of_mesh(const TriangleMesh& mesh, const PictureView& view) {
  Raster raster(view.camera);
  draw_triangles(mesh, corners_in(view, mesh), raster, [](const auto&, int, int, float, float, float) {});
  cv::Mat depth = 1 / raster.inverse_depth;
  depth.setTo(0, raster.inverse_depth == 0);
  return depth;
}

PictureView overview_of(const TriangleMesh& mesh, const Vector3& up, int width) {
  Vector3 facing = 0.3 * up;  // a little from above, whatever the surface faces
  for (const Eigen::Vector3f& normal : mesh.normals)
    facing += normal.cast<double>() / static_cast<double>(mesh.normals.size());
  return view_from(mesh, facing, up, width);
}

PictureView view_from(const TriangleMesh& mesh, const Vector3& facing, const Vector3& up, int width) {
  Vector3 centre = Vector3::Zero();
  for (const Eigen::Vector3f& p : mesh.positions)
    centre += p.cast<double>() / static_cast<double>(mesh.positions.size());
  Matrix3 R_c_w;
  const Vector3 z = -facing.normalized();
  const Vector3 x = z.cross(Vector3(up + 1e-6 * Vector3(1, 2, 3))).normalized();
  R_c_w << x.transpose(), z.cross(x).transpose(), z.transpose();
  double half_x = 1e-3, half_y = 1e-3, half_z = 1e-3;
  for (const Eigen::Vector3f& p : mesh.positions) {
    const Vector3 d = R_c_w * (p.cast<double>() - centre);
    half_x = std::max(half_x, std::abs(d.x()));
    half_y = std::max(half_y, std::abs(d.y()));
    half_z = std::max(half_z, std::abs(d.z()));
  }
  const double away = 4 * std::max({half_x, half_y, half_z});
  const double f = 0.5 * width * (away - half_z) / half_x;
  const int height = std::clamp(static_cast<int>(2 * f * half_y / (away - half_z)), 16, 4 * width);
  PictureView view;
  view.camera = {f, f, 0.5 * (width - 1), 0.5 * (height - 1), width, height};
  view.T_c_w = SE3(R_c_w, Vector3(-R_c_w * centre + away * Vector3::UnitZ()));
  return view;
}

std::vector<Rgb> error_colours(std::span<const float> errors, double most) {
  constexpr std::array<std::array<float, 3>, 4> kScale{
      {{{30, 60, 200}}, {{40, 170, 90}}, {{250, 210, 40}}, {{210, 30, 30}}}};
  std::vector<Rgb> colours;
  colours.reserve(errors.size());
  for (const float error : errors) {
    const float at = 3 * std::clamp(error / static_cast<float>(most), 0.0f, 1.0f);
    const auto i = std::min<std::size_t>(2, static_cast<std::size_t>(at));
    const float t = at - static_cast<float>(i);
    Rgb colour{};
    for (std::size_t c = 0; c < 3; ++c)
      colour[c] = static_cast<std::uint8_t>(kScale[i][c] + t * (kScale[i + 1][c] - kScale[i][c]));
    colours.push_back(colour);
  }
  return colours;
}

}  // namespace twofold
