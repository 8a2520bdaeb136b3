#include "viewer/surface_layer.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "viewer/wire_format.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMostVertices = 0xffff;  // of a piece: corners are numbers of 16 bit
constexpr float kMargin = 0.5f;                // of a cell, that positions may lie outside of it

template <class T>
void append(const T& value, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// Nothing when it is not finite or too far outside of the cell.
std::optional<std::uint16_t> in_cell(float x, float edge, std::int32_t cell) {
  const double share = (static_cast<double>(x) / edge - cell + kMargin) / (1 + 2 * kMargin);
  if (!(share >= 0 && share <= 1)) return std::nullopt;
  return static_cast<std::uint16_t>(std::lround(65535 * share));
}

std::optional<ViewSurfaceVertex> vertex_of(const SurfacePiece& piece, std::size_t v, float edge) {
  ViewSurfaceVertex vertex;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto position = in_cell(piece.mesh.positions[v][a], edge, piece.cell[a]);
    if (!position) return std::nullopt;
    vertex.position[a] = *position;
    const float normal = v < piece.mesh.normals.size() ? piece.mesh.normals[v][a] : 0;
    vertex.normal[a] = static_cast<std::int8_t>(std::lround(127 * std::clamp(normal, -1.0f, 1.0f)));
    vertex.colour[a] = v < piece.mesh.colours.size() ? piece.mesh.colours[v][a] : 200;
  }
  return vertex;
}

/// Empty when it has nothing that can be shown.
std::string encode(const SurfacePiece& piece, float edge) {
  const SurfaceMesh& mesh = piece.mesh;
  if (mesh.triangles.empty() || mesh.positions.size() > kMostVertices) return {};
  std::string bytes;
  append(piece.cell, bytes);
  append(static_cast<std::uint32_t>(mesh.positions.size()), bytes);
  append(static_cast<std::uint32_t>(mesh.triangles.size()), bytes);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const auto vertex = vertex_of(piece, v, edge);
    if (!vertex) return {};
    append(*vertex, bytes);
  }
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) {
      if (corner >= mesh.positions.size()) return {};
      append(static_cast<std::uint16_t>(corner), bytes);
    }
  }
  bytes.append(bytes.size() % 4, '\0');
  return bytes;
}

std::string no_triangles(const std::array<std::int32_t, 3>& cell) {
  std::string bytes;
  append(cell, bytes);
  append(std::array<std::uint32_t, 2>{}, bytes);
  return bytes;
}

}  // namespace

void SurfaceLayer::forget() {
  pieces_.clear();
  changes_.clear();
  bytes_ = 0;
  began_ = newest_ + 1;
}

void SurfaceLayer::show(std::uint32_t part, double edge, const std::vector<SurfacePiece>& pieces) {
  const auto cell_edge = static_cast<float>(edge);
  if (!(cell_edge > 0) || !std::isfinite(cell_edge)) return;
  if (newest_ == 0 || part != part_ || cell_edge != edge_) forget();
  part_ = part;
  edge_ = cell_edge;
  for (const SurfacePiece& piece : pieces) {
    std::string bytes = encode(piece, cell_edge);
    const bool empty = bytes.empty();
    const auto change = changes_.find(piece.cell);
    if (change == changes_.end() && (empty || bytes_ + bytes.size() > kMostBytes)) continue;
    if (change != changes_.end()) {
      bytes_ -= pieces_.at(change->second).bytes.size();
      pieces_.erase(change->second);
    }
    if (empty) bytes = no_triangles(piece.cell);
    bytes_ += bytes.size();
    changes_[piece.cell] = ++newest_;
    pieces_.emplace(newest_, Piece{piece.cell, std::move(bytes), empty});
  }
}

SurfaceLayer::Message SurfaceLayer::next(std::uint64_t since) const {
  const bool whole = since < began_;
  std::string bytes(sizeof(ViewMessageHeader), '\0');
  append(edge_, bytes);
  append(std::uint32_t{0}, bytes);
  std::uint32_t count = 0;
  std::uint64_t to = newest_;
  for (auto at = pieces_.upper_bound(since); at != pieces_.end(); ++at) {
    if (whole && at->second.empty) continue;  // nobody has anything there
    if (count > 0 && bytes.size() + at->second.bytes.size() > kMessageBytes) {
      to = at->first - 1;
      break;
    }
    bytes += at->second.bytes;
    ++count;
  }
  const ViewMessageHeader header{ViewMessageKind::kSurface, whole ? kWhole : 0U, count, part_};
  std::memcpy(bytes.data(), &header, sizeof header);
  return {std::make_shared<const std::string>(std::move(bytes)), to};
}

std::vector<SurfacePiece> cut_into_pieces(const SurfaceMesh& mesh, double edge) {
  constexpr double kFarthest = 1e9;  // cells from the origin: farther, whole numbers end
  struct Cut {
    SurfaceMesh mesh;
    std::map<std::uint32_t, std::uint32_t> names;
  };
  std::map<std::array<std::int32_t, 3>, Cut> cuts;
  const auto name = [&](Cut& cut, std::uint32_t v) {
    const auto [found, is_new] = cut.names.try_emplace(v, static_cast<std::uint32_t>(cut.names.size()));
    if (is_new) {
      cut.mesh.positions.push_back(mesh.positions[v]);
      if (v < mesh.normals.size()) cut.mesh.normals.push_back(mesh.normals[v]);
      if (v < mesh.colours.size()) cut.mesh.colours.push_back(mesh.colours[v]);
    }
    return found->second;
  };
  for (const auto& triangle : mesh.triangles) {
    if (*std::max_element(triangle.begin(), triangle.end()) >= mesh.positions.size()) continue;
    std::array<std::int32_t, 3> cell{};
    bool fits = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const double at = std::floor(mesh.positions[triangle[0]][a] / edge);
      fits = fits && std::abs(at) < kFarthest;
      if (fits) cell[a] = static_cast<std::int32_t>(at);
      for (const std::uint32_t v : triangle)
        fits = fits && in_cell(mesh.positions[v][a], static_cast<float>(edge), cell[a]).has_value();
    }
    if (!fits) continue;
    Cut& cut = cuts[cell];
    cut.mesh.triangles.push_back({name(cut, triangle[0]), name(cut, triangle[1]), name(cut, triangle[2])});
  }
  std::vector<SurfacePiece> pieces;
  pieces.reserve(cuts.size());
  for (auto& [cell, cut] : cuts) pieces.push_back({cell, std::move(cut.mesh)});
  return pieces;
}

}  // namespace twofold
