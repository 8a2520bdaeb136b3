#include "io/files/mesh_file.hpp"

#include <bit>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"

namespace twofold {
namespace {

static_assert(std::endian::native == std::endian::little,
              "the numbers below are written as they stand in memory");

template <class T>
void append(const T& value, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

void append(const Eigen::Vector3f& x, std::string& bytes) {
  for (const float c : x) append(c, bytes);
}

std::string ply_header(const TriangleMesh& mesh) {
  std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment metres\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\n",
      mesh.positions.size());
  if (!mesh.normals.empty()) header += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!mesh.colours.empty()) header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (!mesh.sigmas.empty()) header += "property float sigma\n";
  if (!mesh.triangles.empty())
    header +=
        fmt::format("element face {}\nproperty list uchar uint vertex_indices\n", mesh.triangles.size());
  return header + "end_header\n";
}

/// A piece of a GLB file's binary part, and what the JSON part says of it.
struct GlbPart {
  nlohmann::ordered_json accessor;
  std::string bytes;
  int target = 0;
};

constexpr int kArrayBuffer = 34962;  // glTF's numbers
constexpr int kElementBuffer = 34963;
constexpr int kGlFloat = 5126;
constexpr int kGlUnsignedInt = 5125;
constexpr int kGlUnsignedShort = 5123;

GlbPart glb_positions(const TriangleMesh& mesh) {
  GlbPart part;
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max());
  Eigen::Vector3f high = -low;
  for (const Eigen::Vector3f& x : mesh.positions) {
    append(x, part.bytes);
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  part.accessor = {{"componentType", kGlFloat}, {"count", mesh.positions.size()}, {"type", "VEC3"}};
  part.accessor["min"] = {low.x(), low.y(), low.z()};
  part.accessor["max"] = {high.x(), high.y(), high.z()};
  part.target = kArrayBuffer;
  return part;
}

GlbPart glb_normals(const TriangleMesh& mesh) {
  GlbPart part;
  for (const Eigen::Vector3f& n : mesh.normals) append(n, part.bytes);
  part.accessor = {{"componentType", kGlFloat}, {"count", mesh.normals.size()}, {"type", "VEC3"}};
  part.target = kArrayBuffer;
  return part;
}

/// Vertices start at multiples of four bytes: a fourth component, opaque, fills them up. glTF's colours are
/// linear in light; those of images are not  (sRGB, IEC 61966-2-1): 8 bits of light would be one for up to
/// thirteen dark levels of theirs.
GlbPart glb_colours(const TriangleMesh& mesh) {
  GlbPart part;
  const auto linear = [](std::uint8_t c) {
    const double s = c / 255.0;
    return static_cast<std::uint16_t>(
        std::lround(65535 * (s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4))));
  };
  for (const auto& colour : mesh.colours) {
    for (const std::uint8_t c : colour) append(linear(c), part.bytes);
    append(std::uint16_t{65535}, part.bytes);
  }
  part.accessor = {{"componentType", kGlUnsignedShort},
                   {"normalized", true},
                   {"count", mesh.colours.size()},
                   {"type", "VEC4"}};
  part.target = kArrayBuffer;
  return part;
}

GlbPart glb_triangles(const TriangleMesh& mesh) {
  GlbPart part;
  for (const auto& t : mesh.triangles) append(t, part.bytes);
  part.accessor = {
      {"componentType", kGlUnsignedInt}, {"count", 3 * mesh.triangles.size()}, {"type", "SCALAR"}};
  part.target = kElementBuffer;
  return part;
}

/// x, y, z, w of the rotation that brings `up` to y: half a turn about x, and what is left then.
nlohmann::ordered_json glb_rotation(const Vector3& up) {
  const Eigen::Quaterniond half(0, 1, 0, 0);
  const Eigen::Quaterniond q = Eigen::Quaterniond::FromTwoVectors(half * up, Vector3::UnitY()) * half;
  return {q.x(), q.y(), q.z(), q.w()};
}

/// Without one it is metal, as glTF has it, which is nearly black where only lamps are.
nlohmann::ordered_json glb_material() {
  return {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}}};
}

std::string glb_bytes(const TriangleMesh& mesh, const Vector3& up) {
  using Json = nlohmann::ordered_json;
  std::vector<GlbPart> parts{glb_positions(mesh), glb_normals(mesh)};
  Json attributes{{"POSITION", 0}, {"NORMAL", 1}};
  if (!mesh.colours.empty()) {
    attributes["COLOR_0"] = parts.size();
    parts.push_back(glb_colours(mesh));
  }
  const std::size_t indices = parts.size();
  parts.push_back(glb_triangles(mesh));
  Json views = Json::array(), accessors = Json::array();
  std::string binary;
  for (GlbPart& part : parts) {
    views.push_back({{"buffer", 0},
                     {"byteOffset", binary.size()},
                     {"byteLength", part.bytes.size()},
                     {"target", part.target}});
    part.accessor["bufferView"] = accessors.size();
    accessors.push_back(part.accessor);
    binary += part.bytes;  // each a multiple of four bytes
  }
  const Json json{
      {"asset", {{"version", "2.0"}, {"generator", "twofold"}}},
      {"scene", 0},
      {"scenes", Json::array({{{"nodes", {0}}}})},
      {"nodes", Json::array({{{"mesh", 0}, {"rotation", glb_rotation(up)}}})},
      {"meshes",
       Json::array({{{"primitives",
                      Json::array({{{"attributes", attributes}, {"indices", indices}, {"material", 0}}})}}})},
      {"materials", Json::array({glb_material()})},
      {"buffers", Json::array({{{"byteLength", binary.size()}}})},
      {"bufferViews", views},
      {"accessors", accessors}};
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::string bytes = "glTF";
  const auto word = [&](std::size_t value) { append(static_cast<std::uint32_t>(value), bytes); };
  word(2);
  word(12 + 8 + text.size() + 8 + binary.size());
  word(text.size());
  bytes += "JSON" + text;
  word(binary.size());
  bytes += std::string("BIN\0", 4) + binary;
  return bytes;
}

}  // namespace

void write_ply_mesh(const std::filesystem::path& file, const TriangleMesh& mesh) {
  std::string bytes = ply_header(mesh);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    append(mesh.positions[v], bytes);
    if (!mesh.normals.empty()) append(mesh.normals[v], bytes);
    if (!mesh.colours.empty()) append(mesh.colours[v], bytes);
    if (!mesh.sigmas.empty()) append(mesh.sigmas[v], bytes);
  }
  for (const auto& t : mesh.triangles) {
    append(std::uint8_t{3}, bytes);
    append(t, bytes);
  }
  write_file(file, bytes);
}

void write_obj_mesh(const std::filesystem::path& file, const TriangleMesh& mesh) {
  fmt::memory_buffer text;
  const auto to = std::back_inserter(text);
  fmt::format_to(to, "# metres\n");
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Eigen::Vector3f& x = mesh.positions[v];
    fmt::format_to(to, "v {:.6f} {:.6f} {:.6f}", x.x(), x.y(), x.z());
    if (!mesh.colours.empty()) {
      const auto& c = mesh.colours[v];
      fmt::format_to(to, " {:.4f} {:.4f} {:.4f}", c[0] / 255.0, c[1] / 255.0, c[2] / 255.0);
    }
    fmt::format_to(to, "\n");
  }
  for (const Eigen::Vector3f& n : mesh.normals)
    fmt::format_to(to, "vn {:.4f} {:.4f} {:.4f}\n", n.x(), n.y(), n.z());
  for (const auto& t : mesh.triangles) {
    if (mesh.normals.empty()) {
      fmt::format_to(to, "f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    } else {
      fmt::format_to(to, "f {0}//{0} {1}//{1} {2}//{2}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    }
  }
  write_file(file, {text.data(), text.size()});
}

void write_glb_mesh(const std::filesystem::path& file, const TriangleMesh& mesh, const Vector3& up) {
  if (mesh.triangles.empty() || mesh.normals.size() != mesh.positions.size())
    throw IoError(file, "a GLB file needs triangles and normals");
  constexpr std::size_t kMost = std::size_t{1} << 32;
  if (28 * mesh.positions.size() + 12 * mesh.triangles.size() + 4096 >= kMost)
    throw IoError(file, "the mesh is too large for a GLB file, which ends at 4 GB");
  write_file(file, glb_bytes(mesh, up));
}

}  // namespace twofold
