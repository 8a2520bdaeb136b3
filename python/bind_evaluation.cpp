#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <array>
#include <memory>

#include <fmt/format.h>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/poses.hpp"
#include "python/trajectory.hpp"
#include "twofold/evaluation.hpp"

namespace twofold::python {
namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Times = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

PoseList make_trajectory(const py::object& given_times, const Doubles& positions,
                         const Doubles& orientations) {
  const py::array times = py::array::ensure(given_times);
  if (!times) throw py::type_error("t_ns must be an array");
  if (times.size() > 0 && times.dtype().kind() != 'i' && times.dtype().kind() != 'u')
    throw py::type_error("t_ns must be integers, nanoseconds");
  const Times t_ns(times);
  const py::ssize_t count = t_ns.size();
  if (t_ns.ndim() != 1) throw py::value_error("t_ns must have shape (N,)");
  if (positions.ndim() != 2 || positions.shape(0) != count || positions.shape(1) != 3)
    throw py::value_error("positions must have shape (N, 3)");
  if (orientations.ndim() != 2 || orientations.shape(0) != count || orientations.shape(1) != 4)
    throw py::value_error("orientations must have shape (N, 4)");
  PoseList trajectory;
  trajectory.poses.resize(static_cast<std::size_t>(count));
  for (py::ssize_t i = 0; i < count; ++i) {
    StampedPose& pose = trajectory.poses[static_cast<std::size_t>(i)];
    pose.t_ns = t_ns.at(i);
    if (i > 0 && t_ns.at(i) <= t_ns.at(i - 1))
      throw py::value_error(
          fmt::format("row {}: t_ns must grow, is {} after {}", i, t_ns.at(i), t_ns.at(i - 1)));
    std::array<double, 3> t{};
    std::array<double, 4> q{};
    std::copy_n(positions.data(i, 0), 3, t.begin());
    std::copy_n(orientations.data(i, 0), 4, q.begin());
    pose.T_world_camera = checked_pose(t, q, fmt::format("row {}: ", i));
  }
  return trajectory;
}

constexpr StampedPose kNone;

/// (N,) or (N, width): one member of every pose, where it is.
template <class T>
py::array column(const py::object& self, const T* (*member)(const StampedPose&), py::ssize_t width) {
  const auto& poses = self.cast<const PoseList&>().poses;
  const T* first = member(poses.empty() ? kNone : poses.front());
  const auto count = static_cast<py::ssize_t>(poses.size());
  constexpr py::ssize_t kStep = sizeof(StampedPose);
  if (width == 1) return view_of(first, {count}, self, {kStep});
  return view_of(first, {count, width}, self, {kStep, sizeof(T)});
}

void bind_trajectory(py::module_& module) {
  py::class_<PoseList>(module, "Trajectory",
                       "Where the camera was, in the order of time. Columns are read-only views.")
      .def(py::init(&make_trajectory), py::arg("t_ns"), py::arg("positions"), py::arg("orientations"),
           "From t_ns (N,) [ns], which must grow, positions (N, 3) [m] and unit quaternions (N, 4), x y z w; "
           "copied. Quaternions within\n0.01 of length 1 are normalised. Raises ValueError naming row and "
           "value.")
      .def_property_readonly(
          "t_ns",
          [](const py::object& self) {
            return column<std::int64_t>(
                self, [](const StampedPose& pose) { return &pose.t_ns; }, 1);
          },
          "(N,) int64 [ns].")
      .def_property_readonly(
          "positions",
          [](const py::object& self) {
            return column<double>(
                self, [](const StampedPose& pose) { return pose.T_world_camera.t.data(); }, 3);
          },
          "(N, 3) [m], in the world.")
      .def_property_readonly(
          "orientations",
          [](const py::object& self) {
            return column<double>(
                self, [](const StampedPose& pose) { return pose.T_world_camera.q.data(); }, 4);
          },
          "(N, 4): unit quaternions x y z w of T_world_camera.")
      .def("__len__", [](const PoseList& self) { return self.poses.size(); })
      .def(
          "pose",
          [](const PoseList& self, std::ptrdiff_t i) {
            const auto count = static_cast<std::ptrdiff_t>(self.poses.size());
            if (i < -count || i >= count) throw py::index_error(fmt::format("pose {} of {}", i, count));
            return self.poses[static_cast<std::size_t>(i < 0 ? i + count : i)].T_world_camera;
          },
          py::arg("index"), "T_world_camera of one.")
      .def(
          "save",
          [](const PoseList& self, const std::filesystem::path& file) { save_trajectory(file, self.poses); },
          py::arg("file"), "TUM form: lines \"time[s] tx ty tz qx qy qz qw\". Raises RuntimeError.")
      .def("__repr__",
           [](const PoseList& self) { return fmt::format("<Trajectory of {} poses>", self.poses.size()); });
  module.def(
      "load_trajectory", [](const std::filesystem::path& file) { return PoseList{load_trajectory(file)}; },
      py::arg("file"),
      "TUM, KITTI or EuRoC form, told by the first line. Raises RuntimeError naming file and line.");
}

void bind_error(py::module_& module) {
  py::class_<TrajectoryError>(module, "TrajectoryError", "How far an estimate is from the truth.")
      .def_readonly("pairs", &TrajectoryError::pairs, "Poses that have a true one.")
      .def_readonly("path_length", &TrajectoryError::path_length, "Of the truth over the pairs [m].")
      .def_readonly("ate_rmse", &TrajectoryError::ate_rmse, "Absolute trajectory error [m].")
      .def_readonly("ate_mean", &TrajectoryError::ate_mean, "[m].")
      .def_readonly("ate_median", &TrajectoryError::ate_median, "[m].")
      .def_readonly("ate_max", &TrajectoryError::ate_max, "[m].")
      .def_readonly("rotation_rmse", &TrajectoryError::rotation_rmse, "[rad].")
      .def_readonly(
          "rpe_rmse", &TrajectoryError::rpe_rmse,
          "Relative error over one second, translation [m]; nan: no two poses are one second apart.")
      .def_readonly("scale", &TrajectoryError::scale, "The estimate's lengths times this are the truth's.")
      .def("__repr__", [](const TrajectoryError& error) {
        return fmt::format("<TrajectoryError over {} poses: ATE {:.4f} m rmse, {:.4f} m at most>",
                           error.pairs, error.ate_rmse, error.ate_max);
      });
  py::enum_<AlignBy>(module, "AlignBy", "What the estimate may be moved by before it is compared.")
      .value("NOTHING", AlignBy::kNothing, "it is compared as it is")
      .value("RIGID_MOTION", AlignBy::kRigidMotion, "rotation and translation")
      .value("SIMILARITY", AlignBy::kSimilarity, "and scale, for one camera");
}

}  // namespace

void bind_evaluation(py::module_& module) {
  bind_trajectory(module);
  bind_error(module);
  module.def(
      "compare",
      [](const PoseList& estimate, const PoseList& truth, AlignBy align, double max_time_difference) {
        const py::gil_scoped_release unlocked;
        return compare(estimate.poses, truth.poses, {align, max_time_difference});
      },
      py::arg("estimate"), py::arg("truth"), py::kw_only(), py::arg("align") = AlignBy::kRigidMotion,
      py::arg("max_time_difference") = ComparisonOptions().max_time_difference_s,
      "The estimate is aligned with the truth first; max_time_difference [s]: between a pose and its true "
      "one.\n"
      "Raises ValueError when there is nothing to compare.");
}

}  // namespace twofold::python
