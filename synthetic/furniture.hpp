#pragma once

#include <array>
#include <numbers>
#include <utility>

#include "synthetic/canvas.hpp"
#include "synthetic/random.hpp"
#include "synthetic/scene.hpp"

namespace twofold::synthetic {

/// Pose of a thing that stands upright at (x, y, z), turned by yaw [rad] about the vertical.
[[nodiscard]] inline SE3 standing(double x, double y, double z, double yaw) {
  return {SO3::exp(Vector3(0, 0, yaw)), Vector3(x, y, z)};
}

/// Sides of a thing, each between both [m].
[[nodiscard]] inline Vector3 random_size(Random& random, const Vector3& least, const Vector3& most) {
  Vector3 size;
  for (int k = 2; k >= 0; --k) size[k] = random.uniform(least[k], most[k]);
  return size;
}

/// Paints the six sides of a box in the order of box_quads; gives the index of the first texture.
/// paint: callable with Canvas&.
template <class Paint>
int add_box_textures(Scene& scene, const Vector3& size, double texel, Paint paint) {
  const std::array<std::pair<double, double>, 6> sides{{{size.x(), size.z()},
                                                        {size.y(), size.z()},
                                                        {size.x(), size.z()},
                                                        {size.y(), size.z()},
                                                        {size.x(), size.y()},
                                                        {size.x(), size.y()}}};
  const auto first = static_cast<int>(scene.textures.size());
  for (const auto& [width, height] : sides) {
    Canvas canvas(width, height, texel, 128);
    paint(canvas);
    scene.add(canvas.finish());
  }
  return first;
}

/// Adds a box centred on the origin of T_w_o; size [m].
template <class Paint>
void add_box(Scene& scene, const SE3& T_w_o, const Vector3& size, double texel, Paint paint) {
  const int first = add_box_textures(scene, size, texel, paint);
  for (const Quad& quad : box_quads(T_w_o, size, first)) scene.quads.push_back(quad);
}

/// Adds an upright cylinder whose base stands at (x, y, z).
template <class Paint>
void add_cylinder(Scene& scene, const Vector3& base, double radius, double height, double texel,
                  Paint paint) {
  Canvas canvas(2 * std::numbers::pi * radius, height, texel, 128);
  paint(canvas);
  scene.cylinders.push_back({base, radius, height, scene.add(canvas.finish()), 0.95});
}

/// Adds a ball with six painted faces.
template <class Paint>
void add_ball(Scene& scene, const Vector3& centre, double radius, double texel, Paint paint) {
  const auto first = static_cast<int>(scene.textures.size());
  for (int face = 0; face < 6; ++face) {
    Canvas canvas(1.6 * radius, 1.6 * radius, texel,
                  128);  // about as long as an eighth of the circumference twice
    paint(canvas);
    scene.add(canvas.finish());
  }
  scene.spheres.push_back({centre, radius, first, 0.95});
}

}  // namespace twofold::synthetic
