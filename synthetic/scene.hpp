#pragma once

#include <cstddef>
#include <vector>

#include "geometry/se3.hpp"
#include "synthetic/texture.hpp"

namespace twofold::synthetic {

/// Rectangle origin + s * s_axis + q * q_axis, s in [0, width], q in [0, height] [m], seen from the side
/// from which s_axis points right and q_axis down (s_axis x q_axis points away). Unit axes. A texture runs
/// along s in u and along q in v; a wall's q_axis points down.
struct Quad {
  Vector3 origin;
  Vector3 s_axis;
  Vector3 q_axis;
  double width = 0;
  double height = 0;
  int texture = 0;
  double brightness = 1;  ///< baked light: the same from every side
};

/// Side of an upright cylinder, seen from outside; the texture goes once around.
struct Cylinder {
  Vector3 base;  ///< centre of the lower rim
  double radius = 0;
  double height = 0;
  int texture = 0;
  double brightness = 1;
};

/// Sphere, seen from outside; six textures (texture ... texture + 5) on the faces of a cube around it, +x -x
/// +y -y +z -z, so that no pole pinches the pattern.
struct Sphere {
  Vector3 centre;
  double radius = 0;
  int texture = 0;
  double brightness = 1;
};

/// Surface z = h(x, y) on a rectangle of the plane, bilinear between samples, texture laid on from above.
///
/// A ray is followed by fixed-point iteration, which needs |slope| * tan(angle between ray and vertical) < 1:
/// true for a camera that looks down on gentle ground, and not a general terrain renderer.
struct HeightField {
  double x0 = 0, y0 = 0;  ///< position of sample (0, 0) [m]
  double spacing = 0.01;  ///< [m]
  cv::Mat heights;        ///< CV_32FC1 [m], rows along y
  int texture = 0;

  /// Between which two samples a coordinate lies (the second is first + 1), and how near the second.
  struct Between {
    int first;
    float weight;
  };

  /// x or y in metres; clamps at the rim.
  [[nodiscard]] Between columns_at(float x) const;
  [[nodiscard]] Between rows_at(float y) const;
  [[nodiscard]] float height_at(float x, float y) const;
};

/// What the renderer draws: primitives in the world frame (z up), the textures they name, and a sky.
struct Scene {
  std::vector<Texture> textures;
  std::vector<Quad> quads;
  std::vector<Cylinder> cylinders;
  std::vector<Sphere> spheres;
  std::vector<HeightField> height_fields;
  double sky_zenith = 170;   ///< grey level straight up
  double sky_horizon = 225;  ///< grey level at the horizon

  /// Index of a texture for the primitives.
  int add(const cv::Mat& canvas);
  /// Each texture becomes its mean grey.
  void strip_textures();
};

/// The six sides of a box with one texture each (texture ... texture + 5: front -y, right +x, back +y, left
/// -x, top +z, bottom -z in the box's own frame), centred on the origin of T_w_o. size in metres along its
/// axes.
[[nodiscard]] std::vector<Quad> box_quads(const SE3& T_w_o, const Vector3& size, int first_texture);

}  // namespace twofold::synthetic
