#pragma once

#include <mutex>
#include <utility>
#include <vector>

#include "twofold/map.hpp"

namespace twofold::python {

/// Map of package twofold: a snapshot, and its tables as far as somebody asked for them.
struct MapRows {
  template <class Row>
  struct Lazy {
    std::once_flag made;
    std::vector<Row> rows;
  };

  explicit MapRows(MapSnapshot map) : snapshot(std::move(map)) {}

  MapSnapshot snapshot;
  Lazy<MapSnapshot::Keyframe> keyframes;
  Lazy<MapSnapshot::Point> points, bare_points;
  Lazy<MapSnapshot::Edge> edges;
  Lazy<MapSnapshot::Loop> loops;
  Lazy<MapSnapshot::Part> parts;
};

}  // namespace twofold::python
