#include "synthetic/view_geometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace twofold::synthetic {
namespace {

constexpr double kNear = 0.02;  ///< [m]
constexpr int kHeightIterations = 24;
constexpr float kHeightTolerance = 1e-5f;  ///< [m]

RayForm form_of(const Vector3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

/// Of whatever is not nearer than z: its largest inverse depth, and a little more than rounding could add.
float nearest_beyond(double z) {
  return z > kNear ? static_cast<float>(1.001 / z) : std::numeric_limits<float>::infinity();
}

/// All rays have met something in front of the inverse depth `nearest`.
bool hidden(float nearest, const RayPacket& rays) {
  float farthest = rays.inverse_depth[0];
  for (const float inverse_depth : rays.inverse_depth)
    farthest = inverse_depth < farthest ? inverse_depth : farthest;
  return farthest >= nearest;
}

/// Part of a convex polygon at depth >= kNear  (Sutherland and Hodgman, 1974).
std::vector<Vector3> clip_near(const std::vector<Vector3>& polygon) {
  std::vector<Vector3> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector3& a = polygon[i];
    const Vector3& b = polygon[(i + 1) % polygon.size()];
    if (a.z() >= kNear) kept.push_back(a);
    if ((a.z() >= kNear) != (b.z() >= kNear)) kept.push_back(a + (kNear - a.z()) / (b.z() - a.z()) * (b - a));
  }
  return kept;
}

}  // namespace

ViewGeometry::ViewGeometry(const Scene& scene, const std::vector<Quad>& extra, const PinholeCamera& camera,
                           const SE3& T_w_c)
    : camera_(camera),
      T_w_c_(T_w_c),
      T_c_w_(T_w_c.inverse()),
      R_w_c_(T_w_c.rotation().cast<float>()),
      eye_(T_w_c.translation().cast<float>()),
      sky_zenith_(static_cast<float>(scene.sky_zenith)),
      sky_horizon_(static_cast<float>(scene.sky_horizon)),
      height_fields_(&scene.height_fields),
      textures_(&scene.textures) {
  const Matrix3 R = T_w_c.rotation();
  dx_ = form_of(R.row(0));
  dy_ = form_of(R.row(1));
  dz_ = form_of(R.row(2));
  for (const Quad& quad : scene.quads) add_quad(scene, quad);
  for (const Quad& quad : extra) add_quad(scene, quad);
  for (const Cylinder& cylinder : scene.cylinders) add_cylinder(scene, cylinder);
  for (const Sphere& sphere : scene.spheres) add_sphere(scene, sphere);
  for (std::size_t i = 0; i < scene.height_fields.size(); ++i)
    visible_.push_back({make_id(kHeightField, i), {0, 0, camera.width - 1, camera.height - 1}});
}

void ViewGeometry::add_visible(std::int32_t id, const std::vector<Vector3>& outline_c) {
  if (outline_c.empty()) return;
  double left = 1e9, top = 1e9, right = -1e9, bottom = -1e9;
  for (const Vector3& p : outline_c) {
    const Vector2 uv = camera_.project(p);
    left = std::min(left, uv.x());
    right = std::max(right, uv.x());
    top = std::min(top, uv.y());
    bottom = std::max(bottom, uv.y());
  }
  if (right < -1 || bottom < -1 || left > camera_.width || top > camera_.height) return;
  const auto clamp = [](double v, int high) { return static_cast<int>(std::clamp(v, 0.0, high - 1.0)); };
  visible_.push_back({id,
                      {clamp(left - 1, camera_.width), clamp(top - 1, camera_.height),
                       clamp(right + 2, camera_.width), clamp(bottom + 2, camera_.height)}});
}

void ViewGeometry::add_quad(const Scene& scene, const Quad& quad) {
  const Vector3 origin_c = T_c_w_ * quad.origin;
  const Matrix3 R_c_w = T_c_w_.rotation();
  const Vector3 s_c = R_c_w * quad.s_axis;
  const Vector3 q_c = R_c_w * quad.q_axis;
  const Vector3 n_c = s_c.cross(q_c);
  const double distance = n_c.dot(origin_c);  // n . x = distance on the plane
  if (distance <= 1e-6) return;               // seen from behind or edge-on
  const std::int32_t id = make_id(kQuad, quads_.size());
  const auto before = visible_.size();
  const Vector3 s = quad.width * s_c;
  const Vector3 q = quad.height * q_c;
  add_visible(id, clip_near({origin_c, origin_c + s, origin_c + s + q, origin_c + q}));
  if (visible_.size() == before) return;
  quads_.push_back({form_of(n_c / distance), form_of(s_c), form_of(q_c),
                    static_cast<float>(s_c.dot(origin_c)), static_cast<float>(q_c.dot(origin_c)),
                    static_cast<float>(quad.width), static_cast<float>(quad.height),
                    &scene.textures[quad.texture], static_cast<float>(quad.brightness)});
}

void ViewGeometry::add_cylinder(const Scene& scene, const Cylinder& cylinder) {
  std::vector<Vector3> corners;
  bool in_front = true;
  bool any = false;
  double nearest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 8; ++i) {
    const Vector3 offset((i & 1 ? 1 : -1) * cylinder.radius, (i & 2 ? 1 : -1) * cylinder.radius,
                         i & 4 ? cylinder.height : 0);
    corners.push_back(T_c_w_ * (cylinder.base + offset));
    in_front = in_front && corners.back().z() > kNear;
    any = any || corners.back().z() > kNear;
    nearest = std::min(nearest, corners.back().z());
  }
  if (!any) return;
  const std::int32_t id = make_id(kCylinder, cylinders_.size());
  const auto before = visible_.size();
  if (in_front) {
    add_visible(id, corners);
    if (visible_.size() == before) return;
  } else {
    visible_.push_back({id, {0, 0, camera_.width - 1, camera_.height - 1}});
  }
  const Vector3 o = T_w_c_.translation() - cylinder.base;
  cylinders_.push_back({static_cast<float>(o.x()), static_cast<float>(o.y()), static_cast<float>(o.z()),
                        static_cast<float>(cylinder.radius), static_cast<float>(cylinder.height),
                        nearest_beyond(nearest), &scene.textures[cylinder.texture],
                        static_cast<float>(cylinder.brightness)});
}

void ViewGeometry::add_sphere(const Scene& scene, const Sphere& sphere) {
  const Vector3 c = T_c_w_ * sphere.centre;
  if (c.z() + sphere.radius < kNear) return;
  const std::int32_t id = make_id(kSphere, spheres_.size());
  const auto before = visible_.size();
  if (c.z() - sphere.radius > kNear) {
    std::vector<Vector3> corners;
    for (int i = 0; i < 8; ++i)
      corners.push_back(c + sphere.radius * Vector3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
    add_visible(id, corners);
    if (visible_.size() == before) return;
  } else {
    visible_.push_back({id, {0, 0, camera_.width - 1, camera_.height - 1}});
  }
  spheres_.push_back({static_cast<float>(c.x()), static_cast<float>(c.y()), static_cast<float>(c.z()),
                      static_cast<float>(sphere.radius), nearest_beyond(c.z() - sphere.radius),
                      &scene.textures[sphere.texture], static_cast<float>(sphere.brightness)});
}

void ViewGeometry::intersect(std::int32_t id, RayPacket& rays) const {
  const std::int32_t index = id & kIndexMask;
  switch (id >> kKindShift) {
    case kQuad:
      return intersect_quad(quads_[index], id, rays);
    case kCylinder:
      return intersect_cylinder(cylinders_[index], id, rays);
    case kSphere:
      return intersect_sphere(spheres_[index], id, rays);
    default:
      return intersect_height_field((*height_fields_)[index], id, rays);
  }
}

void ViewGeometry::intersect_quad(const QuadForm& f, std::int32_t id, RayPacket& rays) const {
  for (int k = 0; k < RayPacket::kSize; ++k) {
    const float x = rays.x[k];
    const float y = rays.y[k];
    const float w = f.w(x, y);
    const float t = 1.0f / w;
    const float s = t * f.s(x, y) - f.s0;
    const float q = t * f.q(x, y) - f.q0;
    const bool hit = (w > rays.inverse_depth[k]) & (s >= 0) & (s <= f.width) & (q >= 0) & (q <= f.height);
    rays.inverse_depth[k] = hit ? w : rays.inverse_depth[k];
    rays.id[k] = hit ? id : rays.id[k];
  }
}

void ViewGeometry::intersect_cylinder(const CylinderForm& f, std::int32_t id, RayPacket& rays) const {
  if (hidden(f.nearest, rays)) return;
  for (int k = 0; k < RayPacket::kSize; ++k) {
    const float dx = dx_(rays.x[k], rays.y[k]);
    const float dy = dy_(rays.x[k], rays.y[k]);
    const float dz = dz_(rays.x[k], rays.y[k]);
    // From the point of the ray nearest to the axis: no difference of large squares.
    const float a = 1.0f / (dx * dx + dy * dy);
    const float nearest = -(f.ox * dx + f.oy * dy) * a;
    const float px = f.ox + nearest * dx;
    const float py = f.oy + nearest * dy;
    const float inside = f.radius * f.radius - (px * px + py * py);
    const float t = nearest - std::sqrt(std::max(inside, 0.0f) * a);
    const float z = f.oz + t * dz;
    const float w = 1.0f / t;
    const bool hit = (inside > 0) & (t > 0) & (z >= 0) & (z <= f.height) & (w > rays.inverse_depth[k]);
    rays.inverse_depth[k] = hit ? w : rays.inverse_depth[k];
    rays.id[k] = hit ? id : rays.id[k];
  }
}

void ViewGeometry::intersect_sphere(const SphereForm& f, std::int32_t id, RayPacket& rays) const {
  if (hidden(f.nearest, rays)) return;
  for (int k = 0; k < RayPacket::kSize; ++k) {
    const float x = rays.x[k];
    const float y = rays.y[k];
    const float a = 1.0f / (x * x + y * y + 1);
    const float nearest = (x * f.cx + y * f.cy + f.cz) * a;
    const float px = nearest * x - f.cx;
    const float py = nearest * y - f.cy;
    const float pz = nearest - f.cz;
    const float inside = f.radius * f.radius - (px * px + py * py + pz * pz);
    const float t = nearest - std::sqrt(std::max(inside, 0.0f) * a);
    const float w = 1.0f / t;
    const bool hit = (inside > 0) & (t > 0) & (w > rays.inverse_depth[k]);
    rays.inverse_depth[k] = hit ? w : rays.inverse_depth[k];
    rays.id[k] = hit ? id : rays.id[k];
  }
}

void ViewGeometry::intersect_height_field(const HeightField& f, std::int32_t id, RayPacket& rays) const {
  const auto x0 = static_cast<float>(f.x0);
  const auto y0 = static_cast<float>(f.y0);
  const auto x1 = static_cast<float>(f.x0 + f.spacing * (f.heights.cols - 1));
  const auto y1 = static_cast<float>(f.y0 + f.spacing * (f.heights.rows - 1));
  float start = f.height_at(eye_.x(), eye_.y());
  for (int k = 0; k < RayPacket::kSize; ++k) {
    const float dx = dx_(rays.x[k], rays.y[k]);
    const float dy = dy_(rays.x[k], rays.y[k]);
    const float dz = dz_(rays.x[k], rays.y[k]);
    if (dz >= -1e-3f) continue;
    // Contracts by |slope| tan(angle to the vertical) each time; the neighbouring ray's height is a good
    // start.
    float height = start;
    float t = 0;
    for (int i = 0; i < kHeightIterations; ++i) {
      t = (height - eye_.z()) / dz;
      const float next = f.height_at(eye_.x() + t * dx, eye_.y() + t * dy);
      const bool done = std::abs(next - height) < kHeightTolerance;
      height = next;
      if (done) break;
    }
    t = (height - eye_.z()) / dz;
    start = height;
    const float x = eye_.x() + t * dx;
    const float y = eye_.y() + t * dy;
    if (t <= 0 || x < x0 || x > x1 || y < y0 || y > y1 || 1 / t <= rays.inverse_depth[k]) continue;
    rays.inverse_depth[k] = 1 / t;
    rays.id[k] = id;
  }
}

}  // namespace twofold::synthetic
