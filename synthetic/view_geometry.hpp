#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "camera/pinhole.hpp"
#include "geometry/se3.hpp"
#include "synthetic/scene.hpp"

namespace twofold::synthetic {

/// Eight rays (x, y, 1) of the camera, and the nearest surface each has met so far. Loops over it have no
/// branches, so that a compiler turns them into vector instructions.
struct RayPacket {
  static constexpr int kSize = 8;
  static constexpr std::int32_t kSky = -1;
  alignas(32) std::array<float, kSize> x;
  alignas(32) std::array<float, kSize> y;
  alignas(32) std::array<float, kSize> inverse_depth;  ///< 0: nothing met
  alignas(32) std::array<std::int32_t, kSize> id;
};

/// Linear function of a ray: f . (x, y, 1).
struct RayForm {
  float x = 0, y = 0, one = 0;
  [[nodiscard]] float operator()(float rx, float ry) const { return x * rx + y * ry + one; }
};

/// Part of the image (inclusive, px) a primitive can touch; empty when left > right.
struct PixelBounds {
  int left = 0, top = 0, right = -1, bottom = -1;
};

/// A scene seen by one camera: every primitive as the coefficients its intersection with a ray (x, y, 1)
/// needs. Positions are taken relative to the camera in double before they are rounded to float.
class ViewGeometry {
 public:
  ViewGeometry(const Scene& scene, const std::vector<Quad>& extra, const PinholeCamera& camera,
               const SE3& T_w_c);

  /// Primitives that may be visible, and where.
  struct Visible {
    std::int32_t id;
    PixelBounds bounds;
  };
  [[nodiscard]] const std::vector<Visible>& visible() const { return visible_; }

  /// Keeps the nearer of what each ray has met and primitive `id`.
  void intersect(std::int32_t id, RayPacket& rays) const;

  /// Grey levels where the rays have met something, of the sky elsewhere. footprint: edge of the area to
  /// average over [px].
  void shade(const RayPacket& rays, float footprint, std::span<float, RayPacket::kSize> grey) const;

 private:
  /// Kind in the upper bits of an id, index below.
  enum Kind : std::int32_t { kQuad, kCylinder, kSphere, kHeightField };
  static constexpr int kKindShift = 24;
  static constexpr std::int32_t kIndexMask = (1 << kKindShift) - 1;
  static std::int32_t make_id(Kind kind, std::size_t index) {
    return (static_cast<std::int32_t>(kind) << kKindShift) | static_cast<std::int32_t>(index);
  }

  /// Inverse depth w . ray; position on the quad s = (s_axis . ray) / w - s0, q alike [m].
  struct QuadForm {
    RayForm w, s, q;
    float s0, q0, width, height;
    const Texture* texture;
    float brightness;
  };
  struct CylinderForm {
    float ox, oy, oz;  ///< camera relative to the centre of the base, world axes
    float radius, height;
    float nearest;  ///< no point of it has a larger inverse depth [1/m]
    const Texture* texture;
    float brightness;
  };
  struct SphereForm {
    float cx, cy, cz;  ///< centre in the camera's frame
    float radius;
    float nearest;  ///< as above
    const Texture* textures;
    float brightness;
  };
  struct SurfacePoint {  ///< on a texture, with its texel footprint for one unit of ray x and y
    const Texture* texture;
    float u, v;
    TexelFootprint per_ray;
    float brightness;
  };

  void add_quad(const Scene& scene, const Quad& quad);
  void add_cylinder(const Scene& scene, const Cylinder& cylinder);
  void add_sphere(const Scene& scene, const Sphere& sphere);
  void add_visible(std::int32_t id, const std::vector<Vector3>& outline_c);

  void intersect_quad(const QuadForm& f, std::int32_t id, RayPacket& rays) const;
  void intersect_cylinder(const CylinderForm& f, std::int32_t id, RayPacket& rays) const;
  void intersect_sphere(const SphereForm& f, std::int32_t id, RayPacket& rays) const;
  void intersect_height_field(const HeightField& f, std::int32_t id, RayPacket& rays) const;

  [[nodiscard]] SurfacePoint on_cylinder(const CylinderForm& f, float x, float y, float t) const;
  [[nodiscard]] SurfacePoint on_sphere(const SphereForm& f, float x, float y, float t) const;
  [[nodiscard]] SurfacePoint on_height_field(const HeightField& f, float x, float y, float t) const;
  /// Footprint from the gradients of u and v along the surface, through its tangent plane.
  [[nodiscard]] TexelFootprint project_footprint(const Eigen::Vector3f& normal, const Eigen::Vector3f& grad_u,
                                                 const Eigen::Vector3f& grad_v, float x, float y,
                                                 float t) const;
  [[nodiscard]] SurfacePoint on_curved(std::int32_t id, float x, float y, float t) const;
  /// shade() for `those` rays (a bit for each), all of which have met `id`.
  void shade_quad(std::int32_t id, const RayPacket& rays, unsigned those, float footprint,
                  std::span<float, RayPacket::kSize> grey) const;
  void shade_curved(std::int32_t id, const RayPacket& rays, unsigned those, float footprint,
                    std::span<float, RayPacket::kSize> grey) const;
  void shade_sky(const RayPacket& rays, unsigned those, std::span<float, RayPacket::kSize> grey) const;
  [[nodiscard]] float sky(float x, float y) const;

  PinholeCamera camera_;
  SE3 T_w_c_, T_c_w_;
  RayForm dx_, dy_, dz_;  ///< ray in world axes
  Eigen::Matrix3f R_w_c_;
  Eigen::Vector3f eye_;  ///< camera centre, world
  float sky_zenith_, sky_horizon_;
  std::vector<QuadForm> quads_;
  std::vector<CylinderForm> cylinders_;
  std::vector<SphereForm> spheres_;
  const std::vector<HeightField>* height_fields_;
  const std::vector<Texture>* textures_;
  std::vector<Visible> visible_;
};

}  // namespace twofold::synthetic
