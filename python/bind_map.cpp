#include "twofold/map.hpp"

#include <fmt/format.h>

#include <mutex>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/map_rows.hpp"

namespace twofold::python {
namespace {

template <class Row>
py::array rows_of(const py::object& self, const std::vector<Row>& rows) {
  return view_of(rows.data(), {static_cast<py::ssize_t>(rows.size())}, self);
}

/// The rows are made without the interpreter's lock; several threads may ask at once.
template <class Row, class Make>
py::array lazily(const py::object& self, MapRows::Lazy<Row> MapRows::*member, const Make& make) {
  auto& map = self.cast<MapRows&>();
  auto& lazy = map.*member;
  {
    const py::gil_scoped_release unlocked;
    std::call_once(lazy.made, [&] { lazy.rows = make(map.snapshot); });
  }
  return rows_of(self, lazy.rows);
}

void register_rows() {
  using Map = MapSnapshot;
  PYBIND11_NUMPY_DTYPE(Map::Keyframe, id, part, frame, t_ns, T_world_camera, points, window, has_place,
                       loaded);
  PYBIND11_NUMPY_DTYPE(Map::Point, id, anchor, observers, part, position, covariance);
  PYBIND11_NUMPY_DTYPE(Map::Edge, from, to, kind, shared_points, T_to_from);
  PYBIND11_NUMPY_DTYPE(Map::Loop, from, to, t_ns, inliers, scale, joins_parts, drift, turned, travelled);
  PYBIND11_NUMPY_DTYPE(Map::Part, id, keyframes);
}

void define_tables(py::class_<MapRows>& rows) {
  rows.def(
          "keyframes",
          [](const py::object& self) {
            return lazily(self, &MapRows::keyframes, [](const MapSnapshot& map) { return map.keyframes(); });
          },
          "(N,) with fields id, part, frame, t_ns [ns], T_world_camera (q: x y z w, t [m]), points (it "
          "sees), window (1, 2:\n"
          "in W1, W2; 0: in neither), has_place (it can be recognised), loaded (it was in the map that the "
          "run "
          "went on with:\n"
          "frame and t_ns are of another recording).")
      .def(
          "points",
          [](const py::object& self, bool covariance) {
            return lazily(self, covariance ? &MapRows::points : &MapRows::bare_points,
                          [covariance](const MapSnapshot& map) { return map.points(covariance); });
          },
          py::arg("covariance") = true,
          "(N,) with fields id, anchor (keyframe it was first seen in), observers (keyframes that see it), "
          "part "
          "(whose world it is in),\n"
          "position (3,) [m], covariance (9,): 3x3 row by row [m^2], NaN where the measurements do not "
          "determine the point;\n"
          "without covariance all of it NaN, at a tenth of the time.")
      .def(
          "edges",
          [](const py::object& self) {
            return lazily(self, &MapRows::edges, [](const MapSnapshot& map) { return map.edges(); });
          },
          "(N,) with fields from, to (> from), kind (0: covisible, 1: marginalised), shared_points, "
          "T_to_from (q, t).")
      .def(
          "loops",
          [](const py::object& self) {
            return lazily(self, &MapRows::loops, [](const MapSnapshot& map) { return map.loops(); });
          },
          "(N,) loops that this run has closed by appearance, in the order they were found, with fields from "
          "(the older\n"
          "keyframe; may be gone by now), to (that came back), t_ns (of it), inliers, scale (lengths around "
          "to "
          "over those around\n"
          "from; 1 but for one camera), joins_parts, drift [m] and turned [rad] (by how much the map had "
          "position and orientation\n"
          "of the keyframe that came back wrong, relative to the older one), travelled [m].")
      .def(
          "parts",
          [](const py::object& self) {
            return lazily(self, &MapRows::parts, [](const MapSnapshot& map) { return map.parts(); });
          },
          "(N,) with fields id, keyframes (their number); one when everything is connected.");
}

using PoseAndPart = std::optional<std::pair<Pose, std::uint32_t>>;

PoseAndPart pose_and_part(const std::optional<MapSnapshot::CameraPose>& pose) {
  return pose ? PoseAndPart({pose->T_world_camera, pose->map_part}) : std::nullopt;
}

PoseAndPart camera_pose(const MapRows& self, const PoseEstimate& estimate) {
  return pose_and_part(self.snapshot.camera_pose(estimate));
}

}  // namespace

void bind_map(py::module_& module) {
  register_rows();
  py::class_<MapRows> rows(
      module, "Map",
      "One version of the map, which never changes and may be held as long as one likes.\n\n"
      "Tables are structured arrays, ascending by id, made when first asked for: read-only views that hold "
      "this object.\n"
      "While it is held, what the map has replaced since stays in memory, at most memory_bytes().");
  rows.def_property_readonly(
          "version", [](const MapRows& self) { return self.snapshot.version(); }, "Grows with every version.")
      .def_property_readonly(
          "reference", [](const MapRows& self) { return known_id(self.snapshot.reference()); },
          "The keyframe that the windows are around: the newest, or the one that the camera came back to. "
          "None "
          "in an empty\n"
          "map.");
  define_tables(rows);
  rows.def("camera_pose", &camera_pose, py::arg("estimate"),
           "Pose [m] that this version has for the camera of a frame tracked at any time, by way of its "
           "reference keyframe or\n"
           "what stands for that now, and the id of its map part: (Pose, part). None: the frame was not "
           "tracked, "
           "or nobody\n"
           "knows (twofold/map.hpp).")
      .def(
          "keyframe_pose",
          [](const MapRows& self, std::uint32_t id) {
            return pose_and_part(self.snapshot.keyframe_pose(id));
          },
          py::arg("id"), "Likewise of a keyframe by its id, which may have been culled.")
      .def(
          "memory_bytes",
          [](const MapRows& self) {
            const py::gil_scoped_release unlocked;
            return self.snapshot.memory_bytes();
          },
          "What it holds, shared with newer versions or not; O(size of the map).")
      .def("__repr__",
           [](const MapRows& self) { return fmt::format("<Map version {}>", self.snapshot.version()); });
}

}  // namespace twofold::python
