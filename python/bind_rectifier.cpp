#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/frames.hpp"
#include "twofold/calibration.hpp"
#include "twofold/rectifier.hpp"

namespace twofold::python {
namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

template <std::size_t N>
std::array<double, N> exactly(const Numbers& given, const char* name) {
  if (given.size() != static_cast<py::ssize_t>(N))
    throw py::value_error(fmt::format("{} must have {} numbers, has {}", name, N, given.size()));
  std::array<double, N> numbers{};
  std::copy_n(given.data(), N, numbers.begin());
  return numbers;
}

CameraInfo make_info(int width, int height, const Numbers& K, const Numbers& D,
                     const std::string& distortion_model, const std::optional<Numbers>& R,
                     const std::optional<Numbers>& P) {
  CameraInfo info{width, height, distortion_model, {D.data(), D.data() + D.size()}, exactly<9>(K, "K")};
  if (R) info.R = exactly<9>(*R, "R");
  if (P) info.P = exactly<12>(*P, "P");
  return info;
}

/// Three rows of a member's numbers.
template <auto kMember>
py::array rows_of(const py::object& self) {
  const auto& numbers = self.cast<const CameraInfo&>().*kMember;
  return view_of(numbers.data(), {3, static_cast<py::ssize_t>(numbers.size()) / 3}, self);
}

void bind_info(py::module_& module) {
  py::class_<CameraInfo>(module, "CameraInfo",
                         "A camera and its lens in numbers, named as in ROS' sensor_msgs/CameraInfo; with "
                         "binning or a region of\ninterest there, make size, K and P those of the images "
                         "first.")
      .def(py::init(&make_info), py::kw_only(), py::arg("width"), py::arg("height"), py::arg("K"),
           py::arg("D") = py::tuple(), py::arg("distortion_model") = CameraInfo().distortion_model,
           py::arg("R") = py::none(), py::arg("P") = py::none(),
           "width, height [px]: of the raw images; K (9,) or (3, 3) [px]; D: coefficients of "
           "'plumb_bob' (k1 k2 p1 p2\n[k3]), 'rational_polynomial' (k1 k2 p1 p2 k3 k4 k5 k6) or "
           "'equidistant' (k1 k2 k3 k4), zeros at the end may be\nleft out; R (9,) or (3, 3), P (12,) or "
           "(3, 4): of a pair whose pose between is not given. Raises ValueError.")
      .def_readonly("width", &CameraInfo::width, "Of the raw images [px].")
      .def_readonly("height", &CameraInfo::height, "Of the raw images [px].")
      .def_readonly("distortion_model", &CameraInfo::distortion_model, "What D is of.")
      .def_property_readonly(
          "D",
          [](const py::object& self) {
            const auto& D = self.cast<const CameraInfo&>().D;
            return view_of(D.data(), {static_cast<py::ssize_t>(D.size())}, self);
          },
          "(N,), read-only.")
      .def_property_readonly("K", &rows_of<&CameraInfo::K>, "(3, 3) [px], read-only.")
      .def_property_readonly("R", &rows_of<&CameraInfo::R>,
                             "(3, 3): rotation from the raw to the rectified camera, read-only.")
      .def_property_readonly("P", &rows_of<&CameraInfo::P>,
                             "(3, 4): of the rectified camera; P[0, 3] = -fx * baseline of the right one. "
                             "Read-only.")
      .def("__repr__", [](const CameraInfo& self) {
        return fmt::format("<CameraInfo {}x{}, fx {:.2f}, {}>", self.width, self.height, self.K[0],
                           self.D.empty() ? "no distortion" : self.distortion_model);
      });
}

FrameRectifier pair_of(const CameraInfo& left, const CameraInfo& right,
                       const std::optional<Pose>& T_right_left) {
  const py::gil_scoped_release unlocked;
  return T_right_left ? FrameRectifier(left, right, *T_right_left) : FrameRectifier(left, right);
}

py::class_<FrameRectifier> bind_constructors(py::module_& module) {
  const py::call_guard<py::gil_scoped_release> unlocked;
  return py::class_<FrameRectifier>(
             module, "FrameRectifier",
             "Makes rectified frames of those that a camera gives, by a calibration: a file, or numbers.")
      .def(py::init<const std::filesystem::path&, int, int, bool>(), py::arg("calibration"),
           py::arg("width") = 0, py::arg("height") = 0, py::arg("left_only") = false,
           "calibration: a file, or a folder in EuRoC's layout, which has a file a camera; width, height "
           "[px]: of the raw\n"
           "images, for calibrations that do not state it; left_only: of such a folder, the left camera "
           "alone. Raises\n"
           "RuntimeError, also for one file of a pair's two.")
      .def(py::init<const BoardCalibration&>(), py::arg("calibration"), unlocked,
           "What a BoardCalibrator found. Raises ValueError, as do those that follow.")
      .def(py::init<const CameraInfo&, Sensor>(), py::arg("camera"), py::kw_only(),
           py::arg("sensor") = Sensor::kMono, unlocked,
           "One camera by its K and D. sensor: MONO, or RGBD with depth images that are the camera's, pixel "
           "by pixel.")
      .def(py::init(&pair_of), py::arg("left"), py::arg("right"), py::kw_only(),
           py::arg("T_right_left") = py::none(),
           "A stereo pair by K and D of both, and the left camera's pose in the right one; without it, by "
           "their R and P.");
}

}  // namespace

void bind_rectifier(py::module_& module) {
  bind_info(module);
  bind_constructors(module)
      .def_property_readonly("rig", &FrameRectifier::rig, py::return_value_policy::copy,
                             "What the rectified frames are of.")
      .def_property_readonly(
          "T_rectified_raw", &FrameRectifier::T_rectified_raw,
          "Pose, a rotation alone, of the calibrated left camera in the one that poses are of:\n"
          "T_world_raw = pose.T_world_camera @ rectifier.T_rectified_raw.")
      .def(
          "rectify",
          [](const FrameRectifier& self, const PythonFrame& raw) {
            const py::gil_scoped_release unlocked;
            return PythonFrame{self.rectify(raw.view), {}};
          },
          py::arg("raw"),
          "Grey images, and depth. Raises ValueError when the frame is not of the calibrated cameras.")
      .def(
          "rectify_in_colour",
          [](const FrameRectifier& self, const PythonFrame& raw) {
            const py::gil_scoped_release unlocked;
            return PythonFrame{self.rectify_in_colour(raw.view), {}};
          },
          py::arg("raw"),
          "The same, with the left image in colour (blue, green, red) if `raw` has it so: for surfaces.");
}

}  // namespace twofold::python
