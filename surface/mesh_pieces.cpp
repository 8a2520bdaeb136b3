#include "surface/mesh_pieces.hpp"

#include <algorithm>
#include <numeric>
#include <unordered_map>

#include "base/right_of_way.hpp"
#include "surface/meshing.hpp"

namespace twofold {
namespace {

void append(const SurfaceVertex& vertex, TriangleMesh& mesh) {
  mesh.positions.push_back(vertex.position);
  mesh.normals.push_back(vertex.normal);
  mesh.colours.push_back(vertex.colour);
  mesh.sigmas.push_back(vertex.sigma);
}

/// The smallest vertex of the piece that a vertex belongs to.
std::vector<std::uint32_t> pieces_of(const TriangleMesh& mesh) {
  std::vector<std::uint32_t> parent(mesh.positions.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const auto& t : mesh.triangles) {
    for (const std::uint32_t v : {t[1], t[2]}) {
      const std::uint32_t a = root(t[0]);
      const std::uint32_t b = root(v);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  for (std::uint32_t v = 0; v < parent.size(); ++v) parent[v] = root(v);
  return parent;
}

template <class T>
void keep(std::vector<T>& values, const std::vector<std::uint32_t>& kept) {
  if (values.empty()) return;
  for (std::size_t n = 0; n < kept.size(); ++n) values[n] = values[kept[n]];
  values.resize(kept.size());
}

void drop_unused_vertices(TriangleMesh& mesh) {
  constexpr std::uint32_t kUnused = 0xffffffff;
  std::vector<std::uint32_t> renamed(mesh.positions.size(), kUnused);
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t v : t) renamed[v] = 0;
  std::vector<std::uint32_t> kept;
  for (std::uint32_t v = 0; v < renamed.size(); ++v) {
    if (renamed[v] == kUnused) continue;
    renamed[v] = static_cast<std::uint32_t>(kept.size());
    kept.push_back(v);
  }
  keep(mesh.positions, kept);
  keep(mesh.normals, kept);
  keep(mesh.colours, kept);
  keep(mesh.sigmas, kept);
  for (auto& t : mesh.triangles)
    for (std::uint32_t& v : t) v = renamed[v];
}

}  // namespace

/// Lets go of those moved_ ones that are among them.
std::vector<std::uint32_t> MeshPieces::outdated(const SurfaceVolume& volume,
                                                std::span<const Pending> pending) {
  const BlockTable& blocks = volume.blocks();
  std::vector<std::uint8_t> is_outdated(blocks.size(), 0);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const BlockHead& block = blocks.head(b);
    if (block.revision <= seen_) continue;
    const BlockPosition& at = block.at;
    for (int n = 0; n < 27; ++n) {
      const auto near = blocks.number_of({at.x + n % 3 - 1, at.y + n / 3 % 3 - 1, at.z + n / 9 - 1});
      if (near) is_outdated[*near] = 1;
    }
    make_way();
  }
  const auto stays = [&](std::uint32_t b) { return !pending.empty() && pending[b] != Pending::kNothing; };
  std::erase_if(moved_, [&](const BlockPosition& at) {
    const auto block = blocks.number_of(at);
    if (block) is_outdated[*block] = 1;
    return !block || !stays(*block);
  });
  std::vector<std::uint32_t> all;
  for (std::uint32_t b = 0; b < is_outdated.size(); ++b)
    if (is_outdated[b] != 0 && !stays(b)) all.push_back(b);
  return all;
}

std::size_t MeshPieces::update(const SurfaceVolume& volume, std::span<const Pending> pending) {
  if (volume.revision() == seen_ && moved_.empty()) return 0;
  const std::uint64_t before = revision_++;
  bool any = false;
  BlockMesh piece;
  if (volume.cleared() > seen_) {
    for (const auto& [at, old] : pieces_)
      if (!volume.blocks().number_of(at)) any |= replace(at, piece);
  }
  // Neighbours that wait, or whose own samples are as before, end in other vertices.
  const bool any_elsewhere = !pending.empty() || !moved_.empty();
  BlockMesher mesher(volume, pending);
  const std::vector<std::uint32_t> blocks = outdated(volume, pending);
  for (const std::uint32_t b : blocks) {
    const BlockPosition& at = volume.blocks().head(b).at;
    mesher.extract(at, piece);
    if (replace(at, piece)) {
      any = true;
      if (any_elsewhere) touch(at);
    }
    make_way();
  }
  if (!any) revision_ = before;
  seen_ = volume.revision();
  return blocks.size();
}

void MeshPieces::move(const std::function<Motion(const Vector3&)>& motion_of) {
  ++revision_;
  std::vector<BlockPosition> moved;
  for (auto& [at, piece] : pieces_) {
    if (piece.mesh.vertices.empty()) continue;
    make_way();
    const Motion motion = motion_of(piece.mesh.vertices.front().position.cast<double>());
    if (motion == Motion::Identity()) continue;
    const Eigen::Matrix3f turn = motion.leftCols<3>().cast<float>();
    const Eigen::Vector3f shift = motion.col(3).cast<float>();
    for (SurfaceVertex& vertex : piece.mesh.vertices) {
      vertex.position = turn * vertex.position + shift;
      vertex.normal = (turn * vertex.normal).normalized();
    }
    moved.push_back(at);
  }
  for (const BlockPosition& at : moved) touch(at);
  if (moved.empty()) --revision_;
  moved_.insert(moved_.end(), moved.begin(), moved.end());
  std::sort(moved_.begin(), moved_.end());
  moved_.erase(std::unique(moved_.begin(), moved_.end()), moved_.end());
}

/// A piece has changed: triangles of the blocks before it end in its vertices.
void MeshPieces::touch(const BlockPosition& at) {
  for (int n = 0; n < 8; ++n) {
    const auto piece = pieces_.find({at.x - (n & 1), at.y - (n >> 1 & 1), at.z - (n >> 2)});
    if (piece != pieces_.end()) piece->second.revision = revision_;
  }
}

bool MeshPieces::replace(const BlockPosition& at, const BlockMesh& piece) {
  const auto old = pieces_.find(at);
  if (old == pieces_.end()) {
    if (piece.empty()) return false;
    pieces_.emplace(at, Piece{piece, revision_});
    return true;
  }
  if (old->second.mesh == piece) return false;
  if (piece.empty())
    old->second.mesh = BlockMesh();  // gives its memory back
  else
    old->second.mesh = piece;  // into the memory it has
  old->second.revision = revision_;
  return true;
}

std::vector<BlockPosition> MeshPieces::changed_since(std::uint64_t revision) const {
  std::vector<BlockPosition> changed;
  for (const auto& [at, piece] : pieces_)
    if (piece.revision > revision && !(revision == 0 && piece.mesh.empty())) changed.push_back(at);
  return changed;
}

MeshPieces::Behind MeshPieces::behind(const BlockPosition& at) const {
  Behind blocks{};
  for (int n = 0; n < 8; ++n) {
    const auto found = pieces_.find({at.x + (n & 1), at.y + (n >> 1 & 1), at.z + (n >> 2)});
    if (found != pieces_.end()) blocks[static_cast<std::size_t>(n)] = &found->second.mesh;
  }
  return blocks;
}

bool MeshPieces::has_all(const Behind& blocks, const std::array<VertexPlace, 3>& triangle) {
  return std::all_of(triangle.begin(), triangle.end(), [&](const VertexPlace& corner) {
    const BlockMesh* block = blocks[corner.block];
    return block != nullptr && block->edges.has(corner.edge);
  });
}

TriangleMesh MeshPieces::piece(const BlockPosition& at) const {
  constexpr std::uint32_t kUnnamed = 0xffffffff;
  TriangleMesh mesh;
  const Behind blocks = behind(at);
  if (blocks[0] == nullptr) return mesh;
  std::array<std::vector<std::uint32_t>, 8> names;
  for (const auto& triangle : blocks[0]->triangles) {
    if (!has_all(blocks, triangle)) continue;
    std::array<std::uint32_t, 3> corners{};
    for (std::size_t i = 0; i < 3; ++i) {
      const BlockMesh& block = *blocks[triangle[i].block];
      const std::uint32_t number = block.edges.number(triangle[i].edge);
      std::vector<std::uint32_t>& named = names[triangle[i].block];
      if (named.empty()) named.resize(block.vertices.size(), kUnnamed);
      if (named[number] == kUnnamed) {
        named[number] = static_cast<std::uint32_t>(mesh.positions.size());
        append(block.vertices[number], mesh);
      }
      corners[i] = named[number];
    }
    mesh.triangles.push_back(corners);
  }
  return mesh;
}

TriangleMesh MeshPieces::joined(int min_triangles) const {
  TriangleMesh mesh;
  std::unordered_map<const BlockMesh*, std::uint32_t> first;
  first.reserve(pieces_.size());
  std::size_t vertices = 0, triangles = 0;
  for (const auto& [at, piece] : pieces_) {
    vertices += piece.mesh.vertices.size();
    triangles += piece.mesh.triangles.size();
  }
  mesh.positions.reserve(vertices);
  mesh.normals.reserve(vertices);
  mesh.colours.reserve(vertices);
  mesh.sigmas.reserve(vertices);
  mesh.triangles.reserve(triangles);
  for (const auto& [at, piece] : pieces_) {
    first.emplace(&piece.mesh, static_cast<std::uint32_t>(mesh.positions.size()));
    for (const SurfaceVertex& vertex : piece.mesh.vertices) append(vertex, mesh);
  }
  for (const auto& [at, piece] : pieces_) {
    if (piece.mesh.triangles.empty()) continue;
    const Behind blocks = behind(at);
    std::array<std::uint32_t, 8> begin{};
    for (std::size_t n = 0; n < 8; ++n)
      if (blocks[n] != nullptr) begin[n] = first.at(blocks[n]);
    const auto name = [&](const VertexPlace& place) {
      return begin[place.block] + blocks[place.block]->edges.number(place.edge);
    };
    for (const auto& t : piece.mesh.triangles)
      if (has_all(blocks, t)) mesh.triangles.push_back({name(t[0]), name(t[1]), name(t[2])});
  }
  drop_small_pieces(mesh, min_triangles);
  return mesh;
}

std::size_t MeshPieces::bytes() const {
  std::size_t sum = 0;
  for (const auto& [at, piece] : pieces_) {
    make_way();
    sum += sizeof(at) + sizeof(piece) + piece.mesh.vertices.capacity() * sizeof(SurfaceVertex) +
           piece.mesh.triangles.capacity() * sizeof(piece.mesh.triangles[0]);
  }
  return sum;
}

std::size_t drop_small_pieces(TriangleMesh& mesh, int least) {
  const std::vector<std::uint32_t> piece = pieces_of(mesh);
  std::vector<int> triangles(mesh.positions.size(), 0);
  for (const auto& t : mesh.triangles) ++triangles[piece[t[0]]];
  const std::size_t before = mesh.triangles.size();
  std::erase_if(mesh.triangles, [&](const auto& t) { return triangles[piece[t[0]]] < least; });
  drop_unused_vertices(mesh);
  return before - mesh.triangles.size();
}

std::size_t drop_pieces_beside(TriangleMesh& mesh, const Vector3& up) {
  const std::vector<std::uint32_t> piece = pieces_of(mesh);
  std::vector<int> triangles(mesh.positions.size(), 0), vertices(mesh.positions.size(), 0);
  for (const auto& t : mesh.triangles) ++triangles[piece[t[0]]];
  const auto largest =
      static_cast<std::uint32_t>(std::max_element(triangles.begin(), triangles.end()) - triangles.begin());
  const auto across = [&](const Vector3& x) -> Vector3 { return x - up.dot(x) * up; };
  std::vector<Vector3> middle(mesh.positions.size(), Vector3::Zero());  // of each piece
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    middle[piece[v]] += across(mesh.positions[v].cast<double>());
    ++vertices[piece[v]];
  }
  for (std::size_t p = 0; p < middle.size(); ++p) middle[p] /= std::max(vertices[p], 1);
  double reach = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    if (piece[v] == largest)
      reach = std::max(reach, (across(mesh.positions[v].cast<double>()) - middle[largest]).norm());
  const std::size_t before = mesh.triangles.size();
  std::erase_if(mesh.triangles,
                [&](const auto& t) { return (middle[piece[t[0]]] - middle[largest]).norm() > reach; });
  drop_unused_vertices(mesh);
  return before - mesh.triangles.size();
}

TriangleMesh extract_mesh(const SurfaceVolume& volume) {
  MeshPieces pieces;
  pieces.update(volume);
  return pieces.joined(volume.options().min_triangles);
}

}  // namespace twofold
