#include "synthetic/scene_mesh.hpp"

#include <cmath>
#include <numbers>

namespace twofold::synthetic {
namespace {

constexpr int kAround = 96;  // corners of a circle

class MeshBuilder {
 public:
  std::uint32_t add(const Vector3& x) {
    mesh.positions.emplace_back(x.cast<float>());
    return static_cast<std::uint32_t>(mesh.positions.size()) - 1;
  }
  /// Corners anticlockwise seen from outside.
  void quad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  }

  /// A sheet of (columns + 1) x (rows + 1) corners; from outside, columns go to the right and rows down.
  template <class Corner>
  void sheet(int columns, int rows, Corner corner) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (int j = 0; j <= rows; ++j)
      for (int i = 0; i <= columns; ++i) add(corner(i, j));
    const auto at = [&](int i, int j) { return first + static_cast<std::uint32_t>(j * (columns + 1) + i); };
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) quad(at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
  }

  TriangleMesh mesh;
};

}  // namespace

TriangleMesh mesh_of(const Scene& scene) {
  MeshBuilder builder;
  for (const Quad& q : scene.quads)
    builder.sheet(1, 1, [&](int i, int j) {
      return Vector3(q.origin + i * q.width * q.s_axis + j * q.height * q.q_axis);
    });
  for (const Cylinder& c : scene.cylinders)
    builder.sheet(kAround, 1, [&](int i, int j) {
      const double angle = 2 * std::numbers::pi * i / kAround;
      return Vector3(c.base +
                     Vector3(c.radius * std::cos(angle), c.radius * std::sin(angle), (1 - j) * c.height));
    });
  for (const Sphere& s : scene.spheres)
    builder.sheet(kAround, kAround / 2, [&](int i, int j) {
      const double angle = 2 * std::numbers::pi * i / kAround;
      const double down = 2 * std::numbers::pi * j / kAround;
      return Vector3(s.centre + s.radius * Vector3(std::sin(down) * std::cos(angle),
                                                   std::sin(down) * std::sin(angle), std::cos(down)));
    });
  for (const HeightField& f : scene.height_fields)
    builder.sheet(f.heights.cols - 1, f.heights.rows - 1, [&](int i, int j) {
      const int row = f.heights.rows - 1 - j;  // seen from above, y points up
      return Vector3(f.x0 + i * f.spacing, f.y0 + row * f.spacing, f.heights.at<float>(row, i));
    });
  return std::move(builder.mesh);
}

}  // namespace twofold::synthetic
