#include "viewer/surface_layer.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "viewer/client_feed.hpp"

namespace twofold {
namespace {

/// Two triangles in a cell.
SurfacePiece piece_at(std::int32_t x, std::int32_t y, std::int32_t z, float edge = 0.5f) {
  SurfacePiece piece{{x, y, z}, {}};
  const auto corner = [&](float a, float b) {
    piece.mesh.positions.push_back({edge * (static_cast<float>(x) + a), edge * (static_cast<float>(y) + b),
                                    edge * static_cast<float>(z)});
    piece.mesh.normals.push_back({0, 0, -1});
    piece.mesh.colours.push_back({255, 128, 0});
  };
  corner(0, 0);
  corner(1, 0);
  corner(1, 1);
  corner(0, 1);
  piece.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return piece;
}

ViewMessageHeader header_of(const std::string& bytes) {
  ViewMessageHeader header;
  std::memcpy(&header, bytes.data(), sizeof header);
  return header;
}

struct Told {
  std::vector<std::array<std::int32_t, 3>> cells;  // in their order
  std::vector<std::uint32_t> triangles;
  bool whole = false;
  std::size_t messages = 0, most_bytes = 0;
};

/// All that somebody gets who knows the changes up to `since`.
Told told_since(const SurfaceLayer& layer, std::uint64_t since) {
  Told told;
  while (since != layer.newest()) {
    const SurfaceLayer::Message message = layer.next(since);
    EXPECT_GT(message.to, since);
    since = message.to;
    const std::string& bytes = *message.bytes;
    const ViewMessageHeader header = header_of(bytes);
    EXPECT_EQ(header.kind, ViewMessageKind::kSurface);
    told.whole |= header.number == kWhole;
    ++told.messages;
    told.most_bytes = std::max(told.most_bytes, bytes.size());
    std::size_t at = sizeof header + 8;
    for (std::uint32_t n = 0; n < header.a; ++n) {
      std::array<std::int32_t, 3> cell{};
      std::array<std::uint32_t, 2> counts{};
      std::memcpy(cell.data(), bytes.data() + at, sizeof cell);
      std::memcpy(counts.data(), bytes.data() + at + sizeof cell, sizeof counts);
      told.cells.push_back(cell);
      told.triangles.push_back(counts[1]);
      at += 20 + counts[0] * sizeof(ViewSurfaceVertex) + counts[1] * 6 + counts[1] % 2 * 2;
    }
    EXPECT_EQ(at, bytes.size());
  }
  return told;
}

TEST(SurfaceLayer, WritesWhatThePageReads) {
  SurfaceLayer layer;
  SurfacePiece piece = piece_at(1, -2, 3);
  piece.mesh.triangles.push_back({1, 2, 3});  // an odd number
  layer.show(7, 0.5, {piece});
  const SurfaceLayer::Message message = layer.next(0);
  const std::string& bytes = *message.bytes;
  std::string hexadecimal;
  for (const char byte : bytes) {
    constexpr const char* kDigits = "0123456789abcdef";
    const auto value = static_cast<unsigned char>(byte);
    hexadecimal += kDigits[value >> 4];
    hexadecimal += kDigits[value & 15];
  }
  std::ifstream in(TWOFOLD_MESSAGES);
  EXPECT_EQ(hexadecimal, nlohmann::json::parse(in)["surface"].get<std::string>());
}

TEST(SurfaceLayer, TellsWhatChangedSince) {
  SurfaceLayer layer;
  EXPECT_EQ(layer.newest(), 0U);
  layer.show(0, 0.5, {piece_at(0, 0, 0), piece_at(1, 0, 0), piece_at(2, 0, 0)});
  const std::uint64_t before = layer.newest();
  EXPECT_TRUE(told_since(layer, 0).whole);
  EXPECT_EQ(told_since(layer, 0).cells.size(), 3U);
  layer.show(0, 0.5, {piece_at(1, 0, 0), SurfacePiece{{2, 0, 0}, {}}, SurfacePiece{{9, 9, 9}, {}}});
  const Told later = told_since(layer, before);
  EXPECT_FALSE(later.whole);
  EXPECT_EQ(later.cells, (std::vector<std::array<std::int32_t, 3>>{{1, 0, 0}, {2, 0, 0}}));
  EXPECT_EQ(later.triangles, (std::vector<std::uint32_t>{2, 0}));
  EXPECT_EQ(told_since(layer, 0).cells.size(), 2U) << "what is empty is nothing to somebody new";
}

TEST(SurfaceLayer, AnotherPartBeginsAfresh) {
  SurfaceLayer layer;
  layer.show(0, 0.5, {piece_at(0, 0, 0)});
  const std::uint64_t before = layer.newest();
  layer.show(3, 0.5, {piece_at(5, 0, 0)});
  const Told told = told_since(layer, before);
  EXPECT_TRUE(told.whole);
  EXPECT_EQ(told.cells, (std::vector<std::array<std::int32_t, 3>>{{5, 0, 0}}));
  EXPECT_EQ(header_of(*layer.next(before).bytes).b, 3U);
}

TEST(SurfaceLayer, ManyPiecesComeInMessagesOfABoundedSize) {
  SurfaceLayer layer;
  std::vector<SurfacePiece> pieces;
  for (int n = 0; n < 5000; ++n) pieces.push_back(piece_at(n, 0, 0));
  layer.show(0, 0.5, pieces);
  const Told told = told_since(layer, 0);
  EXPECT_EQ(std::set(told.cells.begin(), told.cells.end()).size(), 5000U);
  EXPECT_EQ(told.cells.size(), 5000U);
  EXPECT_GT(told.messages, 3U);
  EXPECT_LE(told.most_bytes, SurfaceLayer::kMessageBytes);
}

TEST(SurfaceLayer, LeavesOutWhatCannotBeShown) {
  SurfaceLayer layer;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<SurfacePiece> bad(4, piece_at(0, 0, 0));
  bad[0].mesh.positions[0] = {nan, 0, 0};
  bad[1].mesh.positions[1] = {100, 0, 0};
  bad[2].mesh.triangles[0] = {0, 1, 4};
  bad[3].mesh.positions.resize(70000, {0, 0, 0});
  layer.show(0, 0.5, bad);
  EXPECT_EQ(layer.newest(), 0U);
  for (const double edge : {0.0, -1.0, std::numeric_limits<double>::infinity()})
    layer.show(0, edge, {piece_at(0, 0, 0)});
  EXPECT_EQ(layer.newest(), 0U);
}

TEST(SurfaceLayer, MeshesAreCutIntoCells) {
  SurfaceMesh mesh;
  for (int n = 0; n < 100; ++n)
    for (const float y : {0.0f, 0.1f}) mesh.positions.push_back({0.1f * static_cast<float>(n), y, 0});
  for (std::uint32_t n = 0; n + 2 < 200; ++n) mesh.triangles.push_back({n, n + 1, n + 2});
  mesh.triangles.push_back({0, 1, 199});  // too long
  mesh.triangles.push_back({0, 1, 200});  // without a vertex
  std::size_t triangles = 0;
  const auto pieces = cut_into_pieces(mesh, 1.0);
  EXPECT_EQ(pieces.size(), 10U);
  for (const SurfacePiece& piece : pieces) {
    triangles += piece.mesh.triangles.size();
    for (const auto& t : piece.mesh.triangles)
      for (const std::uint32_t v : t) ASSERT_LT(v, piece.mesh.positions.size());
  }
  EXPECT_EQ(triangles, 198U);
  SurfaceLayer layer;
  layer.show(0, 1.0, pieces);
  EXPECT_EQ(told_since(layer, 0).cells.size(), 10U);
}

TEST(SurfaceLayer, ReachesClientsAfterAllElse) {
  ViewScene scene;
  const ViewTitle title;
  ClientFeed feed(scene, title);
  ViewSight sight;
  const auto kinds = [&] {
    std::vector<ViewMessageKind> all;
    while (const auto message = feed.next(sight)) {
      if (!message->text) all.push_back(header_of(*message->bytes).kind);
      EXPECT_TRUE(feed.take("ack"));
    }
    return all;
  };
  scene.surface().show(0, 0.5, {piece_at(0, 0, 0)});
  scene.add(PoseEstimate(), {});
  EXPECT_EQ(kinds(),
            (std::vector{ViewMessageKind::kFrames, ViewMessageKind::kDelta, ViewMessageKind::kSurface}));
  EXPECT_TRUE(kinds().empty());
  scene.surface().show(0, 0.5, {piece_at(0, 0, 0)});
  feed.end("over");
  EXPECT_FALSE(feed.is_done());
  EXPECT_EQ(kinds(), (std::vector{ViewMessageKind::kSurface}));
  EXPECT_TRUE(feed.is_done());
}

}  // namespace
}  // namespace twofold
