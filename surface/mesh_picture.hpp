#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "camera/pinhole.hpp"
#include "geometry/se3.hpp"
#include "geometry/triangle_mesh.hpp"

namespace twofold {

using Rgb = std::array<std::uint8_t, 3>;

/// A camera and where it stands.
struct PictureView {
  PinholeCamera camera;
  SE3 T_c_w;
};

/// A mesh as a camera sees it, CV_8UC3; triangles seen from behind are left out, so that a room can be looked
/// into through its walls. The mesh has normals.
/// @param colours  one a vertex; empty: the form alone, shaded by the normals
[[nodiscard]] cv::Mat draw_mesh(const TriangleMesh& mesh, std::span<const Rgb> colours,
                                const PictureView& view);

/// Depth of the same triangles, CV_32FC1 [m]; 0 where there is none. Triangles that reach to within 2 cm of
/// the camera are left out: large ones are to be subdivided before. Needs no normals.
[[nodiscard]] cv::Mat depth_of_mesh(const TriangleMesh& mesh, const PictureView& view);

/// From far away, against the mean direction that the surface faces, filling a picture of this width [px].
/// up: direction that is up in the picture, in the mesh's frame.
[[nodiscard]] PictureView overview_of(const TriangleMesh& mesh, const Vector3& up, int width);

/// From far away in the direction `facing`, filling a picture of this width [px].
[[nodiscard]] PictureView view_from(const TriangleMesh& mesh, const Vector3& facing, const Vector3& up,
                                    int width);

/// Blue, green, yellow, red from 0 to `most` [m].
[[nodiscard]] std::vector<Rgb> error_colours(std::span<const float> errors, double most);

}  // namespace twofold
