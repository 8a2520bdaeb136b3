#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <mutex>
#include <optional>
#include <shared_mutex>

#include <fmt/format.h>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/frames.hpp"
#include "python/map_rows.hpp"
#include "twofold/surface.hpp"

namespace twofold::python {
namespace {

using Positions = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Python's threads need not know who may ask while who adds.
template <class Surface>
struct Shared {
  template <class... Arguments>
  explicit Shared(const Arguments&... arguments) : surface(arguments...) {}
  Surface surface;
  mutable std::shared_mutex mutex;  // never held by a thread that wants the interpreter's lock
};
using Model = Shared<SurfaceModel>;
using OfMap = Shared<MapSurface>;  // whose snapshots need no turn

/// An array over values that it owns from now on.
template <class T>
py::array array_over(std::vector<T> values) {
  auto* owned = new std::vector<T>(std::move(values));
  const py::capsule owner(owned, [](void* v) { delete static_cast<std::vector<T>*>(v); });
  return py::array(py::dtype::of<T>(), {static_cast<py::ssize_t>(owned->size())}, {}, owned->data(), owner);
}

/// What `at` says of each row, without the interpreter's lock.
template <class At>
py::array ask(const Positions& positions, const At& at) {
  if (positions.ndim() != 2 || positions.shape(1) != 3)
    throw py::value_error("positions must be of shape (N, 3)");
  const auto count = static_cast<std::size_t>(positions.shape(0));
  const double* x = positions.data();
  std::vector<SpacePoint> points;
  {
    const py::gil_scoped_release unlocked;
    points.reserve(count);
    for (std::size_t n = 0; n < count; ++n, x += 3) points.push_back(at({x[0], x[1], x[2]}));
  }
  return array_over(std::move(points));
}

template <class T>
py::array rows_of_three(const std::vector<std::array<T, 3>>& rows, const py::object& owner) {
  return view_of(reinterpret_cast<const T*>(rows.data()), {static_cast<py::ssize_t>(rows.size()), 3}, owner);
}

DistanceBox box_of(const std::array<double, 3>& min_corner, const std::array<double, 3>& max_corner,
                   double resolution, double max_distance, bool unknown_is_obstacle) {
  return {min_corner, max_corner, resolution, max_distance, unknown_is_obstacle};
}

void bind_mesh(py::module_& module) {
  py::class_<SurfaceMesh>(module, "SurfaceMesh",
                          "Triangles, which go round anticlockwise seen from outside. Arrays are read-only "
                          "views that hold this object.")
      .def_property_readonly(
          "positions",
          [](const py::object& self) {
            return rows_of_three(self.cast<const SurfaceMesh&>().positions, self);
          },
          "(N, 3) float32, in the world [m]: of a run, y points down.")
      .def_property_readonly(
          "normals",
          [](const py::object& self) { return rows_of_three(self.cast<const SurfaceMesh&>().normals, self); },
          "(N, 3) float32, unit, pointing outside.")
      .def_property_readonly(
          "colours",
          [](const py::object& self) { return rows_of_three(self.cast<const SurfaceMesh&>().colours, self); },
          "(N, 3) uint8: red, green, blue.")
      .def_property_readonly(
          "triangles",
          [](const py::object& self) {
            return rows_of_three(self.cast<const SurfaceMesh&>().triangles, self);
          },
          "(M, 3) uint32: numbers of their corners.")
      .def(
          "save", &save_mesh, py::arg("file"), py::arg("up") = std::array<double, 3>{0, -1, 0},
          py::call_guard<py::gil_scoped_release>(),
          "Writes a file of the kind that its name ends in: .ply, .obj or .glb, where `up` (unit) becomes y, "
          "which is up there.\nRaises RuntimeError when it cannot, ValueError for other names and for a .glb "
          "without triangles.")
      .def("__repr__", [](const SurfaceMesh& self) {
        return fmt::format("<SurfaceMesh: {} triangles>", self.triangles.size());
      });
}

void bind_distances(py::module_& module) {
  const auto shape = [](const DistanceField& field) {
    return std::vector<py::ssize_t>{field.size[2], field.size[1], field.size[0]};
  };
  py::class_<DistanceField>(module, "DistanceField",
                            "A Euclidean signed distance field (ESDF): how far the nearest surface is, "
                            "whichever way it lies, in the middle\nof each cell of a box.")
      .def_readonly("min_corner", &DistanceField::min_corner, "Corner of cell [0, 0, 0] [m].")
      .def_readonly("resolution", &DistanceField::resolution, "Edge of a cell [m].")
      .def_property_readonly(
          "distances",
          [shape](const py::object& self) {
            const auto& field = self.cast<const DistanceField&>();
            return view_of(field.distances.data(), shape(field), self);
          },
          "(Z, Y, X) float32 [m], negative inside a surface and in unknown cells (unless distances was told "
          "otherwise): a read-only view.")
      .def_property_readonly(
          "states",
          [shape](const py::object& self) {
            const auto& field = self.cast<const DistanceField&>();
            return view_of(reinterpret_cast<const std::uint8_t*>(field.states.data()), shape(field), self);
          },
          "(Z, Y, X) uint8, numbers of SpaceState: a read-only view.")
      .def(
          "at",
          [](const DistanceField& self, const Positions& positions) {
            return ask(positions, [&](const std::array<double, 3>& x) { return self.at(x); });
          },
          py::arg("positions"),
          "Of positions (N, 3) [m], linear between the middles of cells: (N,) with fields as SurfaceModel.at "
          "has them.");
}

constexpr const char* kAtDoc =
    "What is known of positions: (N, 3) [m] -> (N,) with fields state (number of a SpaceState), distance (to "
    "the surface\n[m], positive outside; ends at four voxels) and gradient (3,).";
constexpr const char* kDistancesDoc =
    "Of each cell of a box, as far as max_distance, how far the nearest surface is, whichever way it lies: a "
    "DistanceField.\nCorners are (3,) [m], resolution and max_distance in metres. Raises ValueError for more "
    "than 2^26 cells.\nUnknown space is an obstacle: cells there are negative, as far as it is to "
    "free space, which the gradient leads to.\nunknown_is_obstacle=False: only surfaces count, and unknown "
    "cells are "
    "positive, also behind a wall: look at `states`.";

/// Questions that both kinds of surfaces answer.
template <class Class, class Questions>
void bind_questions(Class& surface, const Questions& questions) {
  surface
      .def(
          "at",
          [questions](const typename Class::type& self, const Positions& positions) {
            return ask(positions, [&](const std::array<double, 3>& x) {
              return questions(self, [&](const auto& asked) { return asked.at(x); });
            });
          },
          py::arg("positions"), kAtDoc)
      .def(
          "distances",
          [questions](const typename Class::type& self, const std::array<double, 3>& min_corner,
                      const std::array<double, 3>& max_corner, double resolution, double max_distance,
                      bool unknown) {
            const py::gil_scoped_release unlocked;
            return questions(self, [&](const auto& asked) {
              return asked.distances(box_of(min_corner, max_corner, resolution, max_distance, unknown));
            });
          },
          py::arg("min_corner"), py::arg("max_corner"), py::kw_only(), py::arg("resolution") = 0.1,
          py::arg("max_distance") = 1.0, py::arg("unknown_is_obstacle") = true, kDistancesDoc)
      .def(
          "mesh",
          [questions](const typename Class::type& self) {
            const py::gil_scoped_release unlocked;
            return questions(self, [&](const auto& asked) { return asked.mesh(); });
          },
          "The surface as a SurfaceMesh.")
      .def(
          "memory_bytes",
          [questions](const typename Class::type& self) {
            const py::gil_scoped_release unlocked;
            return questions(self, [&](const auto& asked) { return asked.memory_bytes(); });
          },
          "Of all that is kept.");
}

SurfaceModelOptions model_options(double voxel_size, double max_depth, double max_free_depth,
                                  double min_stereo_depth) {
  return {voxel_size, max_depth, max_free_depth, min_stereo_depth};
}

void bind_changes(py::module_& module) {
  py::class_<SurfacePiece>(module, "SurfacePiece", "The part of a mesh that lies in one cell of a grid.")
      .def_readonly("cell", &SurfacePiece::cell, "Its lowest corner (3,), in cells.")
      .def_readonly("mesh", &SurfacePiece::mesh, "Without triangles: nothing is there any more.");
  py::class_<SurfaceChanges>(module, "SurfaceChanges", "What changed in a mesh since a revision.")
      .def_readonly("revision", &SurfaceChanges::revision, "That it leads to.")
      .def_readonly("cell_size", &SurfaceChanges::cell_size, "Edge of a cell [m].")
      .def_property_readonly(
          "pieces",
          [](const py::object& self) {
            py::list pieces;
            for (const SurfacePiece& piece : self.cast<const SurfaceChanges&>().pieces)
              pieces.append(py::cast(&piece, py::return_value_policy::reference_internal, self));
            return pieces;
          },
          "SurfacePieces, which replace what was there.");
}

void bind_model(py::module_& module) {
  py::class_<Model> model(module, "SurfaceModel",
                          "A dense surface from frames with poses, for planners and models: a truncated "
                          "signed distance field (TSDF volume).\n\n"
                          "Where poses are corrected afterwards, MapSurface moves with the map.");
  model
      .def(py::init([](const CameraRig& rig, double voxel_size, double max_depth, double max_free_depth,
                       double min_stereo_depth) {
             return std::make_unique<Model>(
                 rig, model_options(voxel_size, max_depth, max_free_depth, min_stereo_depth));
           }),
           py::arg("rig"), py::kw_only(), py::arg("voxel_size") = 0.05, py::arg("max_depth") = 0.0,
           py::arg("max_free_depth") = 0.0, py::arg("min_stereo_depth") = 0.0,
           "voxel_size: distance of two samples [m]. Readings farther than max_depth begin no surface, and "
           "free "
           "space is kept as far\nas max_free_depth from the camera [m]; 0: as far as there are readings. "
           "Stereo "
           "depth is looked for from\nmin_stereo_depth on [m]; 0: from CameraRig.depth_min, or 0.4 if that "
           "is nearer. "
           "Raises ValueError for a rig without depth.")
      .def(
          "add",
          [](Model& self, const PythonFrame& frame, const Pose& T_world_camera) {
            const py::gil_scoped_release unlocked;
            const std::unique_lock lock(self.mutex);
            return self.surface.add(frame.view, T_world_camera);
          },
          py::arg("frame"), py::arg("T_world_camera"),
          "Adds the depth of a rectified frame, taken there; says how many pixels had a reading. Raises "
          "ValueError for images\nthat do not fit the rig.")
      .def(
          "clear",
          [](Model& self) {
            const py::gil_scoped_release unlocked;
            const std::unique_lock lock(self.mutex);
            self.surface.clear();
          },
          "Forgets all.")
      .def(
          "mesh_changes",
          [](Model& self, std::uint64_t since) {
            const py::gil_scoped_release unlocked;
            const std::unique_lock lock(self.mutex);
            return self.surface.mesh_changes(since);
          },
          py::arg("since") = 0,
          "What changed in the mesh after that revision, as SurfaceChanges; of 0 on, all of it. Only cells "
          "that "
          "frames changed are\nmade anew. Small specks, which `mesh` leaves out, are there.");
  bind_questions(model, [](const Model& self, const auto& question) {
    const std::shared_lock lock(self.mutex);
    return question(self.surface);
  });
}

void bind_map_surface(py::module_& module) {
  py::class_<SurfaceSnapshot> snapshot(
      module, "SurfaceSnapshot",
      "The surface of a run as it was in one version of its map: it does not change any more. Before the "
      "first question is\nanswered its submaps are joined, which takes about 0.2 s for 100 MB: prepare() "
      "does that on another thread.");
  snapshot
      .def_property_readonly("map_version", &SurfaceSnapshot::map_version,
                             "Of the map that it fits; 0: of nothing.")
      .def_property_readonly(
          "map_part", [](const SurfaceSnapshot& self) { return known_id(self.map_part()); },
          "Whose world positions are in; None: of nothing.");
  snapshot.def("prepare", &SurfaceSnapshot::prepare, py::call_guard<py::gil_scoped_release>(),
               "Joins the submaps now, unless that was done.");
  snapshot.def(
      "camera_pose",
      [](const SurfaceSnapshot& self, const PoseEstimate& pose, const MapRows* map) {
        return self.camera_pose(pose, map != nullptr ? map->snapshot : MapSnapshot());
      },
      py::arg("pose"), py::arg("map") = nullptr,
      "T_world_camera of a tracked frame in the world that this surface is in, which a correction of the map "
      "may have moved\nagainst the pose's. map: newer than both (Slam.map()), for reference keyframes that "
      "the "
      "snapshot does not have yet. None\nwhere that is not known, or another map part.");
  bind_questions(snapshot, [](const SurfaceSnapshot& self, const auto& question) { return question(self); });
  py::class_<SurfaceUpdate>(module, "SurfaceUpdate",
                            "What MapSurface.update did, and what was left out since the update before.")
      .def_readonly("fused", &SurfaceUpdate::fused, "Keyframes whose depth was added.")
      .def_readonly("fused_anew", &SurfaceUpdate::fused_anew,
                    "Depth images that were fused once more, since poses in their submaps had changed.")
      .def_readonly("no_readings", &SurfaceUpdate::no_readings, "Keyframes without depth in range.")
      .def_readonly("beyond_memory", &SurfaceUpdate::beyond_memory,
                    "Keyframes left out: memory_mb is reached.")
      .def_readonly("discarded", &SurfaceUpdate::discarded, "Frames that are no keyframes of the map.")
      .def_readonly("overtaken", &SurfaceUpdate::overtaken, "Oldest frames of more than 64 that waited.")
      .def_readonly("waiting", &SurfaceUpdate::waiting, "Frames whose keyframes the map does not have yet.")
      .def("__repr__", [](const SurfaceUpdate& self) {
        return fmt::format(
            "<SurfaceUpdate: {} fused, {} anew, {} left out, {} waiting>", self.fused, self.fused_anew,
            self.no_readings + self.beyond_memory + self.discarded + self.overtaken, self.waiting);
      });
  py::class_<OfMap>(module, "MapSurface",
                    "The surface of a run's keyframes, which moves with its map: as `twofold run --surface` "
                    "makes it, whose\nmin_stereo_depth is 0.4. Rows of a slipped stereo pair are taken back.")
      .def(py::init([](const MapRows& map, double voxel_size, double max_depth, double max_free_depth,
                       double min_stereo_depth, double memory_mb) {
             return std::make_unique<OfMap>(
                 map.snapshot,
                 MapSurfaceOptions{model_options(voxel_size, max_depth, max_free_depth, min_stereo_depth),
                                   memory_mb});
           }),
           py::arg("map"), py::kw_only(), py::arg("voxel_size") = 0.05, py::arg("max_depth") = 0.0,
           py::arg("max_free_depth") = 0.0, py::arg("min_stereo_depth") = 0.0, py::arg("memory_mb") = 2000.0,
           "map: of the run, before its first keyframe; it tells the rig. Beyond memory_mb [MiB] no keyframe "
           "is added. The\nothers: as SurfaceModel.")
      .def(
          "add",
          [](OfMap& self, const PythonFrame& frame, std::int64_t number) {
            const py::gil_scoped_release unlocked;
            const std::unique_lock lock(self.mutex);
            self.surface.add(frame.view, number);
          },
          py::arg("frame"), py::arg("number"),
          "The frame of a keyframe (PoseEstimate.keyframe), before or after the map has it; number: "
          "PoseEstimate.frame.\nRaises ValueError for images that do not fit the rig, and for a number that "
          "does not grow.")
      .def(
          "update",
          [](OfMap& self, const MapRows& map) {
            const py::gil_scoped_release unlocked;
            const std::unique_lock lock(self.mutex);
            return self.surface.update(map.snapshot);
          },
          py::arg("map"),
          "Takes the newest map: submaps move, and all that waits is fused. A SurfaceUpdate says how much, "
          "and "
          "what was left out.")
      .def(
          "mesh_changes",
          [](OfMap& self, std::uint64_t since) {
            const py::gil_scoped_release unlocked;
            const std::unique_lock lock(self.mutex);
            return self.surface.mesh_changes(since);
          },
          py::arg("since") = 0,
          "What changed in the mesh of the camera's map part after that revision, as of the last update: "
          "SurfaceChanges; of 0 on, all of it. Small specks, which SurfaceSnapshot.mesh leaves out, are "
          "there. "
          "What is joined for it takes memory beside memory_mb.")
      .def(
          "snapshot",
          [](const OfMap& self, const std::optional<std::uint32_t>& part) {
            return part ? self.surface.snapshot(*part) : self.surface.snapshot();
          },
          py::arg("part") = py::none(),
          "As of the end of the last update: a SurfaceSnapshot, of the map part that the camera is in, or of "
          "another one\n(PoseEstimate.map_part). Waits for no update.")
      .def(
          "memory_bytes", [](const OfMap& self) { return self.surface.memory_bytes(); },
          "Of samples and depth images, at the end of the last call of add or update.");
}

}  // namespace

void bind_surface(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(SpacePoint, state, distance, gradient);
  py::enum_<SpaceState>(module, "SpaceState", "What is known of a position.")
      .value("UNKNOWN", SpaceState::kUnknown, "never seen, or hidden")
      .value("FREE", SpaceState::kFree, "outside every surface")
      .value("OCCUPIED", SpaceState::kOccupied, "inside a surface, as far as the truncation");
  bind_mesh(module);
  bind_distances(module);
  bind_changes(module);
  bind_model(module);
  bind_map_surface(module);
}

}  // namespace twofold::python
