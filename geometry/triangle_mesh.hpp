#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace twofold {

/// A surface as triangles. Seen from outside, the corners of a triangle go round anticlockwise.
///
/// normals, colours and sigmas are either empty or one a vertex.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> positions;            ///< [m]
  std::vector<Eigen::Vector3f> normals;              ///< unit, pointing outside
  std::vector<std::array<std::uint8_t, 3>> colours;  ///< red, green, blue
  std::vector<float> sigmas;  ///< standard deviation of the position along the normal [m]
  std::vector<std::array<std::uint32_t, 3>> triangles;

  friend bool operator==(const TriangleMesh&, const TriangleMesh&) = default;
};

}  // namespace twofold
