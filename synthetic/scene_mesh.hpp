#pragma once

#include "geometry/triangle_mesh.hpp"
#include "synthetic/scene.hpp"

namespace twofold::synthetic {

/// The surfaces of a scene as triangles, in its world frame, without what moves. Round things are cut so fine
/// that they lie within a tenth of a millimetre for radii of up to 10 cm. Positions and triangles only.
[[nodiscard]] TriangleMesh mesh_of(const Scene& scene);

}  // namespace twofold::synthetic
