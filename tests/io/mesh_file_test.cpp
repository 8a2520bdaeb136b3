#include "io/files/mesh_file.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "io/files/io_error.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

TriangleMesh sample_mesh() {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0.5f}, {0, 1, 0}, {-1.25f, 1, 2}};
  mesh.normals.assign(4, Eigen::Vector3f::UnitZ());
  mesh.colours = {{1, 2, 3}, {4, 5, 6}, {255, 0, 9}, {7, 8, 200}};
  mesh.sigmas.assign(4, 0.001f);
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

std::string refusal(const std::string& file) {
  try {
    (void)read_ply_mesh(file);
  } catch (const IoError& error) {
    return error.what();
  }
  return "";
}

TEST(MeshFile, PlyIsReadBack) {
  const ScratchFolder folder;
  write_ply_mesh(folder / "a.ply", sample_mesh());
  TriangleMesh expected = sample_mesh();
  expected.sigmas.clear();  // not read
  EXPECT_EQ(read_ply_mesh(folder / "a.ply"), expected);
}

TEST(MeshFile, PlyOfOthersIsRead) {
  const ScratchFolder folder;
  std::ofstream(folder / "a.ply")
      << "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement vertex 4\r\n"
         "property double x\r\nproperty double y\r\nproperty double z\r\n"
         "property float quality\r\nelement face 1\r\n"
         "property uchar flags\r\nproperty list uchar int vertex_index\r\nend_header\r\n"
         "0 0 0 1\r\n1 0 0 1\r\n1 1 0 1\r\n0 1 0 1\r\n7 4 0 1 2 3\r\n";
  const TriangleMesh mesh = read_ply_mesh(folder / "a.ply");
  ASSERT_EQ(mesh.positions.size(), 4u);
  ASSERT_EQ(mesh.triangles.size(), 2u);
  EXPECT_EQ(mesh.triangles[1], (std::array<std::uint32_t, 3>{0, 2, 3}));
}

// The beginning of a header: one vertex with a colour.
constexpr const char* kColouredVertex =
    "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\n";

TEST(MeshFile, PlyWithTwoSetsOfVerticesHasColoursOfAllOrNone) {
  const ScratchFolder folder;
  std::ofstream(folder / "a.ply") << kColouredVertex
                                  << "element vertex 2\nproperty float x\nproperty float y\n"
                                     "property float z\nend_header\n0 0 0 1 2 3\n1 0 0\n1 1 0\n";
  const TriangleMesh mesh = read_ply_mesh(folder / "a.ply");
  EXPECT_EQ(mesh.positions.size(), 3u);
  EXPECT_TRUE(mesh.colours.empty()) << mesh.colours.size();
}

TEST(MeshFile, PlyColoursBeyondAByteEndAtIt) {
  const ScratchFolder folder;
  std::ofstream(folder / "a.ply") << kColouredVertex << "end_header\n0 0 0 1e300 -1e300 7\n";
  const TriangleMesh mesh = read_ply_mesh(folder / "a.ply");
  ASSERT_EQ(mesh.colours.size(), 1u);
  EXPECT_EQ(mesh.colours[0], (std::array<std::uint8_t, 3>{255, 0, 7}));
}

TEST(MeshFile, DamagedPlyIsRefused) {
  const ScratchFolder folder;
  write_ply_mesh(folder / "a.ply", sample_mesh());
  const std::string whole = bytes_of(folder / "a.ply");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = whole;
    text.replace(text.find(from), from.size(), to);
    std::ofstream(folder / "b.ply", std::ios::binary) << text;
    return refusal(folder / "b.ply");
  };
  EXPECT_NE(with("vertex 4", "vertex 4000000000000").find("too short"), std::string::npos);
  EXPECT_NE(with("vertex 4", "vertex -4").find("no count"), std::string::npos);
  EXPECT_NE(with("face 2", "face 3").find("ends in the middle"), std::string::npos);
  EXPECT_NE(with("property float x", "property float q").find("no finite position"), std::string::npos);
  EXPECT_NE(with("binary_little", "binary_big").find("not read here"), std::string::npos);
  EXPECT_NE(with("end_header", "the_end").find("not understood"), std::string::npos);
  std::string text = whole;
  text[text.size() - 2] = 1;  // the last corner is now a far one
  std::ofstream(folder / "b.ply", std::ios::binary) << text;
  EXPECT_NE(refusal(folder / "b.ply").find("names vertex"), std::string::npos);
}

TEST(MeshFile, AnyDamageIsRefusedOrRead) {
  const ScratchFolder folder;
  write_ply_mesh(folder / "a.ply", sample_mesh());
  const std::string whole = bytes_of(folder / "a.ply");
  std::mt19937 random(1);
  for (int n = 0; n < 3000; ++n) {
    std::string text = whole.substr(0, n % 3 == 0 ? random() % whole.size() : whole.size());
    for (unsigned k = 0; k < 1 + random() % 4 && !text.empty(); ++k)
      text[random() % text.size()] = static_cast<char>(random());
    std::ofstream(folder / "b.ply", std::ios::binary) << text;
    try {
      const TriangleMesh mesh = read_ply_mesh(folder / "b.ply");
      for (const auto& t : mesh.triangles)
        for (const std::uint32_t v : t) ASSERT_LT(v, mesh.positions.size());
    } catch (const IoError&) {  // as good
    }
  }
}

TEST(MeshFile, GlbIsUprightWhateverIsUp) {
  const ScratchFolder folder;
  for (const Vector3& up : {Vector3(0, -1, 0), Vector3(0, 0, 1), Vector3(0, 1, 0), Vector3(0.6, 0, -0.8)}) {
    write_glb_mesh(folder / "a.glb", sample_mesh(), up);
    const std::string bytes = bytes_of(folder / "a.glb");
    std::uint32_t size = 0;
    std::memcpy(&size, bytes.data() + 12, 4);
    const auto q =
        nlohmann::json::parse(bytes.substr(20, size))["nodes"][0]["rotation"].get<std::vector<double>>();
    EXPECT_NEAR((Eigen::Quaterniond(q[3], q[0], q[1], q[2]) * up).y(), 1, 1e-12);
  }
}

TEST(MeshFile, GlbKeepsAllLevelsOfDarkColours) {
  const ScratchFolder folder;
  TriangleMesh mesh = sample_mesh();
  mesh.colours = {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}, {9, 128, 255}};
  write_glb_mesh(folder / "a.glb", mesh);
  const std::string bytes = bytes_of(folder / "a.glb");
  std::uint32_t json_size = 0;
  std::memcpy(&json_size, bytes.data() + 12, 4);
  const auto json = nlohmann::json::parse(bytes.substr(20, json_size));
  const std::size_t colours = json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"];
  EXPECT_EQ(json["accessors"][colours]["componentType"], 5123);
  const std::size_t view = json["accessors"][colours]["bufferView"];
  const std::size_t offset = json["bufferViews"][view]["byteOffset"];
  std::array<std::uint16_t, 16> light{};
  std::memcpy(light.data(), bytes.data() + 20 + json_size + 8 + offset, sizeof light);
  // c / 12.92 / 255 for the dark ones, in steps of 1 / 65535  (IEC 61966-2-1).
  for (std::size_t c = 0; c < 10; ++c)
    EXPECT_EQ(light[4 * (c / 3) + c % 3], std::lround(65535 * static_cast<double>(c) / 12.92 / 255)) << c;
  EXPECT_NEAR(light[13], 0.2158605 * 65535, 1);
  EXPECT_EQ(light[14], 65535);
  EXPECT_EQ(light[15], 65535) << "opaque";
}

TEST(MeshFile, GlbHoldsTheMesh) {
  const ScratchFolder folder;
  const TriangleMesh mesh = sample_mesh();
  write_glb_mesh(folder / "a.glb", mesh);
  const std::string bytes = bytes_of(folder / "a.glb");
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    return value;
  };
  ASSERT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2u);
  EXPECT_EQ(word(8), bytes.size());
  const std::size_t json_size = word(12);
  EXPECT_EQ(json_size % 4, 0u);
  const auto json = nlohmann::json::parse(bytes.substr(20, json_size));
  const std::size_t binary = 20 + json_size + 8;
  EXPECT_EQ(word(20 + json_size), bytes.size() - binary);
  EXPECT_EQ(json["buffers"][0]["byteLength"], bytes.size() - binary);
  EXPECT_EQ(json["accessors"][0]["count"], 4);
  EXPECT_EQ(json["accessors"][0]["min"][0], -1.25);
  const std::size_t indices = json["meshes"][0]["primitives"][0]["indices"];
  const std::size_t view = json["accessors"][indices]["bufferView"];
  const std::size_t offset = json["bufferViews"][view]["byteOffset"];
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(word(binary + offset + 4 * i), mesh.triangles[i / 3][i % 3]);
  const std::size_t material = json["meshes"][0]["primitives"][0].value("material", 99);
  ASSERT_LT(material, json.value("materials", nlohmann::json::array()).size()) << "metal, by default";
  EXPECT_EQ(json["materials"][material]["pbrMetallicRoughness"]["metallicFactor"], 0);
  // y is up in glTF: down in the mesh, or z.
  EXPECT_EQ(json["nodes"][0]["rotation"], (nlohmann::json{1.0, 0.0, 0.0, 0.0}));
  TriangleMesh none = mesh;
  none.triangles.clear();
  EXPECT_THROW(write_glb_mesh(folder / "b.glb", none), IoError);
}

}  // namespace
}  // namespace twofold
