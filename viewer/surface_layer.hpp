#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "twofold/surface.hpp"

namespace twofold {

/// The mesh of a surface as the page gets it: pieces, each with the number of its last change, so that
/// somebody who knows the changes up to one gets the others in their order, in messages of a bounded size.
/// One thread.
class SurfaceLayer {
 public:
  /// A message ends with the piece that goes beyond this.
  static constexpr std::size_t kMessageBytes = 64U << 10;
  /// Beyond this no new piece is shown.
  static constexpr std::size_t kMostBytes = 256U << 20;

  /// Replaces these pieces. A mesh of another map part, or of other cells, replaces all there is.
  /// @param edge  of a cell, in the map's unit > 0
  void show(std::uint32_t part, double edge, const std::vector<SurfacePiece>& pieces);

  /// Number of the newest change; 0: there is no mesh.
  [[nodiscard]] std::uint64_t newest() const { return newest_; }
  struct Message {
    std::shared_ptr<const std::string> bytes;
    std::uint64_t to = 0;  ///< of the last change in it
  };
  /// What comes after this change. Not for since = newest().
  [[nodiscard]] Message next(std::uint64_t since) const;

 private:
  using Cell = std::array<std::int32_t, 3>;
  struct Piece {
    Cell cell{};
    std::string bytes;  // as it is sent
    bool empty = false;
  };

  void forget();

  std::uint32_t part_ = 0;
  float edge_ = 0;
  std::uint64_t newest_ = 0;
  std::uint64_t began_ = 0;  // who knows less must forget what it knows
  std::map<std::uint64_t, Piece> pieces_;
  std::map<Cell, std::uint64_t> changes_;
  std::size_t bytes_ = 0;
};

/// A mesh cut into cells of this edge, by the triangles' first corners. Triangles that reach out of their
/// cell by half its edge or more are left out.
[[nodiscard]] std::vector<SurfacePiece> cut_into_pieces(const SurfaceMesh& mesh, double edge);

}  // namespace twofold
