#include <pybind11/operators.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/poses.hpp"
#include "twofold/eigen.hpp"
#include "twofold/estimate.hpp"

namespace twofold::python {
namespace {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;

void expect_shape(const Array& array, py::ssize_t last, const char* what) {
  if (array.ndim() < 1 || array.ndim() > 2 || array.shape(array.ndim() - 1) != last)
    throw py::value_error(what);
}

Pose make_pose(const Array& t, const Array& q) {
  if (t.ndim() != 1 || t.shape(0) != 3) throw py::value_error("t must have shape (3,)");
  if (q.ndim() != 1 || q.shape(0) != 4) throw py::value_error("q must have shape (4,)");
  return checked_pose({t.at(0), t.at(1), t.at(2)}, {q.at(0), q.at(1), q.at(2), q.at(3)}, "");
}

/// (3,) or (N, 3) points of frame b in frame a.
py::array transform_points(const Pose& T_a_b, const Array& points_b) {
  expect_shape(points_b, 3, "points must have shape (3,) or (N, 3)");
  py::array_t<double> points_a(
      std::vector<py::ssize_t>(points_b.shape(), points_b.shape() + points_b.ndim()));
  const double* from = points_b.data();
  double* to = points_a.mutable_data();
  for (py::ssize_t i = 0; i < points_b.size(); i += 3) {
    const auto p_a = transform(T_a_b, {from[i], from[i + 1], from[i + 2]});
    std::copy(p_a.begin(), p_a.end(), to + i);
  }
  return points_a;
}

py::array matrix_of(const Pose& T_a_b) {
  py::array_t<double> matrix({4, 4});
  auto m = matrix.mutable_unchecked<2>();
  const Pose R_a_b{T_a_b.q, {0, 0, 0}};
  for (py::ssize_t column = 0; column < 3; ++column) {
    std::array<double, 3> axis{};
    axis[static_cast<std::size_t>(column)] = 1;
    const auto turned = transform(R_a_b, axis);
    for (py::ssize_t row = 0; row < 3; ++row) m(row, column) = turned[static_cast<std::size_t>(row)];
    m(column, 3) = T_a_b.t[static_cast<std::size_t>(column)];
    m(3, column) = 0;
  }
  m(3, 3) = 1;
  return matrix;
}

Pose pose_of_matrix(const Array& T_a_b) {
  constexpr double kTolerance = 1e-3;  // as of float32, or of some decimals
  if (T_a_b.ndim() != 2 || T_a_b.shape(0) != 4 || T_a_b.shape(1) != 4)
    throw py::value_error("T must have shape (4, 4)");
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> T(T_a_b.data());
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  const bool is_rotation = (R * R.transpose()).isIdentity(kTolerance) && R.determinant() > 0;
  if (!T.allFinite() || !is_rotation || !T.row(3).isApprox(Eigen::RowVector4d::UnitW(), kTolerance))
    throw py::value_error("T must be a rigid motion: [R t], R a rotation, above [0 0 0 1]");
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = Eigen::Quaterniond(R).normalized().toRotationMatrix();
  motion.translation() = T.topRightCorner<3, 1>();
  return from_eigen(motion);
}

std::string text_of(const Pose& pose) {
  return fmt::format("Pose(t=[{:.4f}, {:.4f}, {:.4f}], q=[{:.4f}, {:.4f}, {:.4f}, {:.4f}])", pose.t[0],
                     pose.t[1], pose.t[2], pose.q[0], pose.q[1], pose.q[2], pose.q[3]);
}

void bind_pose(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(Pose, q, t);
  py::class_<Pose>(module, "Pose",
                   "Rigid motion T_a_b: takes points of frame b to frame a, p_a = T_a_b @ p_b.")
      .def(py::init<>(), "The identity.")
      .def(py::init(&make_pose), py::arg("t"), py::arg("q"),
           "From t (3,) [m] and the unit quaternion q (4,), x y z w, which is normalised when within 0.01 of "
           "length 1. Raises ValueError.")
      .def_property_readonly(
          "t", [](const py::object& self) { return view_of(self.cast<const Pose&>().t.data(), {3}, self); },
          "Translation (3,) [m], read-only.")
      .def_property_readonly(
          "q", [](const py::object& self) { return view_of(self.cast<const Pose&>().q.data(), {4}, self); },
          "Unit quaternion (4,), x y z w, read-only.")
      .def_static(
          "from_matrix", &pose_of_matrix, py::arg("T"),
          "From the 4x4 matrix T_a_b [R t; 0 0 0 1]; R is made a rotation exactly when it is one within "
          "0.001. Raises ValueError.")
      .def("matrix", &matrix_of, "The 4x4 matrix, a new array.")
      .def("inverse", &inverse, "T_b_a.")
      .def(
          "__matmul__", [](const Pose& a, const Pose& b) { return compose(a, b); }, py::is_operator(),
          "T_a_c = T_a_b @ T_b_c; of points (3,) or (N, 3) [m], a new array of the same shape.")
      .def("__matmul__", &transform_points, py::is_operator())
      .def(py::self == py::self)  // NOLINT(misc-redundant-expression): names the operator
      .def("__repr__", &text_of);
}

void bind_rig(py::module_& module) {
  py::enum_<Sensor>(module, "Sensor", "What the frames are of.")
      .value("STEREO", Sensor::kStereo, "a left and a right image")
      .value("RGBD", Sensor::kRgbd, "an image and its depth")
      .value("MONO", Sensor::kMono, "one camera, right up to its scale");
  const CameraRig d;
  py::class_<CameraRig>(
      module, "CameraRig",
      "A rectified sensor: pinhole cameras without distortion; of a stereo pair the right one is\n"
      "shifted by `baseline` along x.")
      .def(py::init([](Sensor sensor, int width, int height, double fx, double fy, double cx, double cy,
                       double baseline, double depth_unit, double depth_min, double depth_max,
                       std::optional<double> readout) {
             return CameraRig{sensor, width,    height,     fx,        fy,        cx,
                              cy,     baseline, depth_unit, depth_min, depth_max, readout};
           }),
           py::kw_only(), py::arg("sensor") = d.sensor, py::arg("width"), py::arg("height"), py::arg("fx"),
           py::arg("fy"), py::arg("cx"), py::arg("cy"), py::arg("baseline") = d.baseline,
           py::arg("depth_unit") = d.depth_unit, py::arg("depth_min") = d.depth_min,
           py::arg("depth_max") = d.depth_max, py::arg("readout") = d.readout,
           "Sizes, focal lengths and principal point in pixels; baseline in metres, of RGB-D that of the "
           "virtual right\n"
           "camera (0.08), of MONO none; depth_unit: metres per unit of the depth image; readings outside "
           "depth_min to "
           "depth_max [m]\n"
           "are holes; readout of a rolling shutter [s], 0 when all rows are exposed at once, None when it "
           "is\n"
           "to be found out.")
      .def_readwrite("sensor", &CameraRig::sensor, "Sensor: STEREO, RGBD or MONO.")
      .def_readwrite("width", &CameraRig::width, "[px].")
      .def_readwrite("height", &CameraRig::height, "[px].")
      .def_readwrite("fx", &CameraRig::fx, "Focal length along x [px].")
      .def_readwrite("fy", &CameraRig::fy, "Focal length along y [px].")
      .def_readwrite("cx", &CameraRig::cx, "Principal point [px].")
      .def_readwrite("cy", &CameraRig::cy, "Principal point [px].")
      .def_readwrite("baseline", &CameraRig::baseline, "[m]; RGB-D: of the virtual right camera.")
      .def_readwrite("depth_unit", &CameraRig::depth_unit, "Metres per unit of the depth image.")
      .def_readwrite("depth_min", &CameraRig::depth_min, "Nearer readings are holes [m].")
      .def_readwrite("depth_max", &CameraRig::depth_max, "Farther ones likewise [m].")
      .def_readwrite("readout", &CameraRig::readout,
                     "Of a rolling shutter [s]; 0: none; None: to be found out.")
      .def("__repr__", [](const CameraRig& rig) {
        const auto sensor = py::cast(rig.sensor).attr("name").cast<std::string>();
        return fmt::format(
            "<CameraRig {}: {}x{}, fx {:.2f}, fy {:.2f}, cx {:.2f}, cy {:.2f}, baseline {:.4f} m>", sensor,
            rig.width, rig.height, rig.fx, rig.fy, rig.cx, rig.cy, rig.baseline);
      });
}

void bind_estimate(py::module_& module) {
  py::enum_<TrackingState>(module, "TrackingState", "What became of a frame.")
      .value("TRACKED", TrackingState::kTracked, "the pose is known")
      .value("LOST", TrackingState::kLost, "looked at, no trustworthy pose")
      .value("UNPLACED", TrackingState::kUnplaced, "in a loaded map, no place of which was recognised yet");
  py::class_<PoseEstimate>(module, "PoseEstimate", "What is known of the camera at one frame.")
      .def_readonly("frame", &PoseEstimate::frame, "Counts pushed frames from 0, dropped ones included.")
      .def_readonly("t_ns", &PoseEstimate::t_ns, "The frame's own time [ns].")
      .def_readonly("state", &PoseEstimate::state, "TrackingState: tracked, lost or unplaced.")
      .def_property_readonly(
          "tracked", [](const PoseEstimate& pose) { return pose.state == TrackingState::kTracked; },
          "Whether the pose is known; without it, poses, ids, covariance and velocity mean nothing.")
      .def_readonly("keyframe", &PoseEstimate::keyframe, "Whether it was proposed as a keyframe of the map.")
      .def_readonly("effort", &PoseEstimate::effort, "Effort level; 0: nothing was left out.")
      .def_property_readonly(
          "reason", [](const PoseEstimate& pose) { return pose.reason; }, "Why it is lost, in words.")
      .def_readonly("points", &PoseEstimate::points, "Measurements that the pose rests on.")
      .def_readonly("tracked_share", &PoseEstimate::tracked_share,
                    "Those over the points looked for, 0 to 1.")
      .def_readonly("T_world_camera", &PoseEstimate::T_world_camera,
                    "Pose of the left camera [m] in the world of `map_part`.")
      .def_property_readonly(
          "map_part", [](const PoseEstimate& pose) { return known_id(pose.map_part); },
          "Id of the map part, whose world T_world_camera is in: that of its first keyframe, which may be "
          "gone. "
          "None: not\n"
          "tracked.")
      .def_property_readonly(
          "reference_keyframe", [](const PoseEstimate& pose) { return known_id(pose.reference_keyframe); },
          "Id of the keyframe that the pose is known against; None: not tracked.")
      .def_readonly("T_reference_camera", &PoseEstimate::T_reference_camera,
                    "Pose relative to reference_keyframe [m]: this survives corrections of the map.")
      .def_readonly("T_odom_camera", &PoseEstimate::T_odom_camera,
                    "Odometry: a pose [m] in a frame that no correction of the map moves. Drift accumulates; "
                    "map to odometry\n"
                    "is T_world_camera * T_odom_camera.inverse().")
      .def_property_readonly(
          "covariance",
          [](const py::object& self) {
            return view_of(self.cast<const PoseEstimate&>().covariance.data(), {6, 6}, self);
          },
          "(6, 6), read-only: of (translation [m], rotation [rad]) in the camera's axes, relative to the "
          "reference\n"
          "keyframe. All zero for the frame that starts a map part, and defines its world; all NaN when "
          "it is not known.")
      .def_readonly(
          "covariance_known", &PoseEstimate::covariance_known,
          "False when the measurements leave a direction open, and for frames that are not tracked.")
      .def_property_readonly(
          "velocity",
          [](const py::object& self) {
            return view_of(self.cast<const PoseEstimate&>().velocity.data(), {6}, self);
          },
          "(6,), read-only: linear [m/s] and angular [rad/s], in the camera's axes.")
      .def_readonly("map_version", &PoseEstimate::map_version,
                    "Version of the map that it was tracked against.")
      .def_readonly("exposed_ns", &PoseEstimate::exposed_ns,
                    "When the frame was exposed, on CLOCK_MONOTONIC [ns]; without `live` or `speed`, when "
                    "the tracker took it.")
      .def_readonly("latency_ns", &PoseEstimate::latency_ns,
                    "From then to the moment the pose was known [ns].")
      .def("__repr__", [](const PoseEstimate& pose) {
        if (pose.state == TrackingState::kTracked)
          return fmt::format("<PoseEstimate {}: {}>", pose.frame, text_of(pose.T_world_camera));
        return fmt::format("<PoseEstimate {}: {}: {}>", pose.frame, to_string(pose.state), pose.reason);
      });
}

void bind_event(py::module_& module) {
  py::enum_<MapEventKind>(module, "MapEventKind", "Why the camera's pose jumped.")
      .value("OPTIMISATION", MapEventKind::kOptimisation, "a round of the double window")
      .value("LOOP_CLOSURE", MapEventKind::kLoopClosure, "a place was recognised")
      .value("POSE_GRAPH", MapEventKind::kPoseGraph, "the whole pose graph was optimised")
      .value("PARTS_JOINED", MapEventKind::kPartsJoined,
             "the camera's part took another one's world, or another moved into its")
      .value("RELOCALISATION", MapEventKind::kRelocalisation, "the lost camera found itself")
      .value("NEW_PART", MapEventKind::kNewPart, "the lost camera began another part");
  py::class_<MapEvent>(module, "MapEvent", "Why poses given out before are no longer what the map says.")
      .def_readonly("kind", &MapEvent::kind, "MapEventKind.")
      .def_readonly("frame", &MapEvent::frame, "The first that saw it.")
      .def_readonly("t_ns", &MapEvent::t_ns, "That frame's time [ns].")
      .def_readonly("map_version", &MapEvent::map_version, "The corrected version of the map.")
      .def_property_readonly(
          "keyframe", [](const MapEvent& event) { return known_id(event.keyframe); },
          "Reference keyframe of that frame; None: it is lost.")
      .def_property_readonly(
          "map_part_before", [](const MapEvent& event) { return known_id(event.map_part_before); },
          "Part the camera was in; None: it was in none yet.")
      .def_property_readonly(
          "map_part", [](const MapEvent& event) { return known_id(event.map_part); }, "Part it is in now.")
      .def_readonly("T_world_camera_before", &MapEvent::T_world_camera_before,
                    "Pose of the last tracked frame as it was told [m], in the world of map_part_before.")
      .def_readonly(
          "T_world_camera_after", &MapEvent::T_world_camera_after,
          "Where the corrected map has it [m]; after a relocalisation or in a new part, the frame that found "
          "itself.")
      .def_readonly("moved", &MapEvent::moved,
                    "Distance between the two [m]; 0 across map parts, whose worlds share nothing.")
      .def_readonly("turned", &MapEvent::turned, "Angle between the two [rad]; likewise.")
      .def_property_readonly(
          "loop_from", [](const MapEvent& event) { return known_id(event.loop_from); },
          "Of a loop that was closed: the older keyframe. None: no loop, or not known.")
      .def_property_readonly(
          "loop_to", [](const MapEvent& event) { return known_id(event.loop_to); },
          "The keyframe that came back; likewise.")
      .def_readonly("keyframes_moved", &MapEvent::keyframes_moved,
                    "How many moved by a centimetre or 0.2 degrees, or joined another part.")
      .def_readonly("farthest_moved", &MapEvent::farthest_moved, "By a keyframe that kept its part [m].")
      .def_readonly("most_turned", &MapEvent::most_turned, "Likewise [rad].")
      .def("__repr__", [](const MapEvent& event) {
        return fmt::format("<MapEvent {} at frame {}: moved {:.3f} m>", to_string(event.kind), event.frame,
                           event.moved);
      });
}

}  // namespace

void bind_types(py::module_& module) {
  bind_pose(module);
  bind_rig(module);
}

void bind_estimates(py::module_& module) {
  bind_estimate(module);
  bind_event(module);
}

}  // namespace twofold::python
