#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "synthetic/view_geometry.hpp"

namespace twofold::synthetic {
namespace {

constexpr unsigned kAllRays = (1U << RayPacket::kSize) - 1;

/// What was found for `those` rays takes its place among all.
void place(TexturePoints::Floats found, unsigned those, std::span<float, RayPacket::kSize> grey) {
  for (int k = 0; k < RayPacket::kSize; ++k) grey[k] = (those >> k & 1) != 0 ? found[k] : grey[k];
}

}  // namespace

TexelFootprint ViewGeometry::project_footprint(const Eigen::Vector3f& normal, const Eigen::Vector3f& grad_u,
                                               const Eigen::Vector3f& grad_v, float x, float y,
                                               float t) const {
  const Eigen::Vector3f d = R_w_c_ * Eigen::Vector3f(x, y, 1);
  const float facing = std::min(normal.dot(d), -1e-3f * normal.norm());  // bounded at the silhouette
  const Eigen::Vector3f along_x = t * (R_w_c_.col(0) - normal.dot(R_w_c_.col(0)) / facing * d);
  const Eigen::Vector3f along_y = t * (R_w_c_.col(1) - normal.dot(R_w_c_.col(1)) / facing * d);
  return {grad_u.dot(along_x), grad_u.dot(along_y), grad_v.dot(along_x), grad_v.dot(along_y)};
}

ViewGeometry::SurfacePoint ViewGeometry::on_cylinder(const CylinderForm& f, float x, float y, float t) const {
  const float px = f.ox + t * dx_(x, y);
  const float py = f.oy + t * dy_(x, y);
  const float pz = f.oz + t * dz_(x, y);
  constexpr float kPi = std::numbers::pi_v<float>;
  const float ku = static_cast<float>(f.texture->width()) / (2 * kPi);  // texels per radian
  const float kv = static_cast<float>(f.texture->height()) / f.height;
  const float inv_r2 = 1 / (f.radius * f.radius);
  return {f.texture, ku * (std::atan2(py, px) + kPi) - 0.5f, kv * (f.height - pz) - 0.5f,
          project_footprint({px, py, 0}, ku * inv_r2 * Eigen::Vector3f(-py, px, 0), {0, 0, -kv}, x, y, t),
          f.brightness};
}

ViewGeometry::SurfacePoint ViewGeometry::on_sphere(const SphereForm& f, float x, float y, float t) const {
  const Eigen::Vector3f p = R_w_c_ * Eigen::Vector3f(t * x - f.cx, t * y - f.cy, t - f.cz);
  int axis = 0;
  p.cwiseAbs().maxCoeff(&axis);
  const int a = (axis + 1) % 3;
  const int b = (axis + 2) % 3;
  const float inv = 1 / std::abs(p[axis]);
  const float sign = p[axis] > 0 ? 1.0f : -1.0f;
  const Texture& texture = f.textures[2 * axis + (p[axis] > 0 ? 0 : 1)];
  const float ku = 0.5f * static_cast<float>(texture.width());
  const float kv = 0.5f * static_cast<float>(texture.height());
  // Cube map: u = p_a / |p_axis|, v = p_b / |p_axis|, both in [-1, 1].
  Eigen::Vector3f grad_u = Eigen::Vector3f::Zero();
  Eigen::Vector3f grad_v = Eigen::Vector3f::Zero();
  grad_u[a] = ku * inv;
  grad_u[axis] = -ku * sign * p[a] * inv * inv;
  grad_v[b] = kv * inv;
  grad_v[axis] = -kv * sign * p[b] * inv * inv;
  return {&texture, ku * (p[a] * inv + 1) - 0.5f, kv * (p[b] * inv + 1) - 0.5f,
          project_footprint(p, grad_u, grad_v, x, y, t), f.brightness};
}

ViewGeometry::SurfacePoint ViewGeometry::on_height_field(const HeightField& f, float x, float y,
                                                         float t) const {
  const float px = eye_.x() + t * dx_(x, y);
  const float py = eye_.y() + t * dy_(x, y);
  const auto h = static_cast<float>(f.spacing);
  const float slope_x = (f.height_at(px + h, py) - f.height_at(px - h, py)) / (2 * h);
  const float slope_y = (f.height_at(px, py + h) - f.height_at(px, py - h)) / (2 * h);
  const Texture& texture = (*textures_)[f.texture];
  const float ku = static_cast<float>(texture.width()) / (h * static_cast<float>(f.heights.cols - 1));
  const float kv = static_cast<float>(texture.height()) / (h * static_cast<float>(f.heights.rows - 1));
  return {&texture, ku * (px - static_cast<float>(f.x0)) - 0.5f, kv * (py - static_cast<float>(f.y0)) - 0.5f,
          project_footprint({-slope_x, -slope_y, 1}, {ku, 0, 0}, {0, kv, 0}, x, y, t), 1.0f};
}

void ViewGeometry::shade(const RayPacket& rays, float footprint,
                         std::span<float, RayPacket::kSize> grey) const {
  for (unsigned left = kAllRays; left != 0;) {
    const std::int32_t id = rays.id[std::countr_zero(left)];
    unsigned those = 0;
    for (int k = 0; k < RayPacket::kSize; ++k) those |= static_cast<unsigned>(rays.id[k] == id) << k;
    if (id == RayPacket::kSky)
      shade_sky(rays, those, grey);
    else if (id >> kKindShift == kQuad)
      shade_quad(id, rays, those, footprint, grey);
    else
      shade_curved(id, rays, those, footprint, grey);
    left &= ~those;
  }
}

ViewGeometry::SurfacePoint ViewGeometry::on_curved(std::int32_t id, float x, float y, float t) const {
  const std::int32_t index = id & kIndexMask;
  switch (id >> kKindShift) {
    case kCylinder:
      return on_cylinder(cylinders_[index], x, y, t);
    case kSphere:
      return on_sphere(spheres_[index], x, y, t);
    default:
      return on_height_field((*height_fields_)[index], x, y, t);
  }
}

void ViewGeometry::shade_curved(std::int32_t id, const RayPacket& rays, unsigned those, float footprint,
                                std::span<float, RayPacket::kSize> grey) const {
  const float sx = footprint / static_cast<float>(camera_.fx);
  const float sy = footprint / static_cast<float>(camera_.fy);
  while (those != 0) {  // a sphere has six textures
    TexturePoints points{};
    const Texture* texture = nullptr;
    float brightness = 0;
    unsigned on_it = 0;
    for (unsigned left = those; left != 0; left &= left - 1) {
      const int k = std::countr_zero(left);
      const SurfacePoint p = on_curved(id, rays.x[k], rays.y[k], 1 / rays.inverse_depth[k]);
      if (texture == nullptr) texture = p.texture;
      if (p.texture != texture) continue;
      on_it |= 1U << k;
      brightness = p.brightness;
      const TexelFootprint& r = p.per_ray;
      points.set(k, p.u, p.v, {r.u_x * sx, r.u_y * sy, r.v_x * sx, r.v_y * sy});
    }
    place(texture->sample(points) * brightness, on_it, grey);
    those &= ~on_it;
  }
}

void ViewGeometry::shade_sky(const RayPacket& rays, unsigned those,
                             std::span<float, RayPacket::kSize> grey) const {
  for (; those != 0; those &= those - 1) {
    const int k = std::countr_zero(those);
    grey[k] = sky(rays.x[k], rays.y[k]);
  }
}

void ViewGeometry::shade_quad(std::int32_t id, const RayPacket& rays, unsigned those, float footprint,
                              std::span<float, RayPacket::kSize> grey) const {
  static_assert(RayPacket::kSize == TexturePoints::kSize);
  const QuadForm& f = quads_[id & kIndexMask];
  // Rays that met something else are in the place of the first.
  const int first = std::countr_zero(those);
  TexturePoints::Floats x, y, inverse_depth;
  for (int k = 0; k < RayPacket::kSize; ++k) {
    const int from = (those >> k & 1) != 0 ? k : first;
    x[k] = rays.x[from];
    y[k] = rays.y[from];
    inverse_depth[k] = rays.inverse_depth[from];
  }
  const auto t = 1 / inverse_depth;
  const auto s = t * (f.s.x * x + f.s.y * y + f.s.one);
  const auto q = t * (f.q.x * x + f.q.y * y + f.q.one);
  const float ku = static_cast<float>(f.texture->width()) / f.width;
  const float kv = static_cast<float>(f.texture->height()) / f.height;
  const float sx = footprint / static_cast<float>(camera_.fx);
  const float sy = footprint / static_cast<float>(camera_.fy);
  // d(S/w) = (dS - (S/w) dw) / w: the homography's exact derivative.
  const TexturePoints points{ku * (s - f.s0) - 0.5f,
                             kv * (q - f.q0) - 0.5f,
                             ku * t * (f.s.x - s * f.w.x) * sx,
                             ku * t * (f.s.y - s * f.w.y) * sy,
                             kv * t * (f.q.x - q * f.w.x) * sx,
                             kv * t * (f.q.y - q * f.w.y) * sy};
  place(f.texture->sample(points) * f.brightness, those, grey);
}

float ViewGeometry::sky(float x, float y) const {
  const float up = dz_(x, y) / std::sqrt(x * x + y * y + 1);
  return sky_horizon_ + (sky_zenith_ - sky_horizon_) * std::clamp(up, 0.0f, 1.0f);
}

}  // namespace twofold::synthetic
