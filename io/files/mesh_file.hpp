#pragma once

#include <filesystem>

#include "geometry/triangle_mesh.hpp"
#include "geometry/types.hpp"

namespace twofold {

/// Writes a mesh, or, without triangles, a point cloud, as a binary little-endian PLY: x y z, and what the
/// mesh has of nx ny nz, red green blue and sigma, all float but the colours. Throws IoError when the file
/// cannot be written in full.
void write_ply_mesh(const std::filesystem::path& file, const TriangleMesh& mesh);

/// Reads a PLY file of any writer: ascii or binary little endian, vertices with x y z, faces of three corners
/// or more, which become fans. Other properties are skipped, but for normals and colours of bytes. Throws
/// IoError saying what is wrong: numbers in the header that the file is too short for, corners that are not
/// there, coordinates that are not finite.
[[nodiscard]] TriangleMesh read_ply_mesh(const std::filesystem::path& file);

/// Wavefront OBJ: vertices with colours behind the coordinates, normals, faces. Throws as above.
void write_obj_mesh(const std::filesystem::path& file, const TriangleMesh& mesh);

/// Binary glTF 2.0: one mesh with positions, normals and colours, whose node turns `up` (unit) to y, which is
/// up there: cameras' own axes have y down. Throws as above, and for a mesh without triangles or normals, or
/// one of 4 GB or more.
void write_glb_mesh(const std::filesystem::path& file, const TriangleMesh& mesh,
                    const Vector3& up = -Vector3::UnitY());

}  // namespace twofold
