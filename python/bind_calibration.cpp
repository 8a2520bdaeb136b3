#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/frames.hpp"
#include "twofold/calibration.hpp"

namespace twofold::python {
namespace {

py::array_t<double> corners_of(const CalibratedCamera& camera) {
  py::array_t<double> rows({static_cast<py::ssize_t>(camera.corners.size()), py::ssize_t{4}});
  auto out = rows.mutable_unchecked<2>();
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const CalibratedCamera::Corner& corner = camera.corners[static_cast<std::size_t>(i)];
    out(i, 0) = corner.x;
    out(i, 1) = corner.y;
    out(i, 2) = corner.dx;
    out(i, 3) = corner.dy;
  }
  return rows;
}

void bind_results(py::module_& module) {
  py::class_<CalibratedCamera>(module, "CalibratedCamera",
                               "A lens as a calibration found it: pinhole with radial-tangential distortion.")
      .def_readonly("width", &CalibratedCamera::width, "Of the raw images [px].")
      .def_readonly("height", &CalibratedCamera::height, "Of the raw images [px].")
      .def_readonly("fx", &CalibratedCamera::fx, "Focal length [px].")
      .def_readonly("fy", &CalibratedCamera::fy, "Focal length [px].")
      .def_readonly("cx", &CalibratedCamera::cx, "Principal point [px].")
      .def_readonly("cy", &CalibratedCamera::cy, "Principal point [px].")
      .def_readonly("fx_std", &CalibratedCamera::fx_std, "Standard deviation [px].")
      .def_readonly("fy_std", &CalibratedCamera::fy_std, "Standard deviation [px].")
      .def_readonly("cx_std", &CalibratedCamera::cx_std, "Standard deviation [px].")
      .def_readonly("cy_std", &CalibratedCamera::cy_std, "Standard deviation [px].")
      .def_readonly("distortion", &CalibratedCamera::distortion, "k1, k2, p1, p2, as OpenCV has them.")
      .def_readonly("rms_px", &CalibratedCamera::rms_px, "Reprojection error of a corner [px].")
      .def_readonly("coverage", &CalibratedCamera::coverage, "Share of the image with corners, 0 to 1.")
      .def_readonly("views", &CalibratedCamera::views, "Views that it rests on.")
      .def_property_readonly(
          "corners", &corners_of,
          "(N, 4): x, y of each corner, and how far from where the camera sees it it was found [px].")
      .def("__repr__", [](const CalibratedCamera& self) {
        return fmt::format("<CalibratedCamera {}x{}, fx {:.2f} +- {:.2f}, rms {:.3f} px>", self.width,
                           self.height, self.fx, self.fx_std, self.rms_px);
      });
  py::class_<BoardCalibration>(module, "BoardCalibration", "One camera, or a stereo pair.")
      .def_readonly("board", &BoardCalibration::board, "By which it was made.")
      .def_readonly("left", &BoardCalibration::left, "CalibratedCamera, the only one or the left one.")
      .def_readonly("right", &BoardCalibration::right, "CalibratedCamera of a pair, else None.")
      .def_readonly("T_right_left", &BoardCalibration::T_right_left,
                    "Pose between a pair's cameras, unrectified.")
      .def_readonly("baseline", &BoardCalibration::baseline, "Of a pair [m].")
      .def_readonly("baseline_std", &BoardCalibration::baseline_std, "Standard deviation [m].")
      .def_readonly("rms_px", &BoardCalibration::rms_px, "Reprojection error of all corners [px].")
      .def("save", &save_calibration, py::arg("file"), py::call_guard<py::gil_scoped_release>(),
           "Writes the file that FrameRectifier and Source read. Raises RuntimeError.");
}

}  // namespace

void bind_calibration(py::module_& module) {
  bind_results(module);
  const BoardCalibrator::Options d;
  py::class_<BoardCalibrator>(module, "BoardCalibrator",
                              "Calibrates one camera or a stereo pair from images of a printed board.")
      .def(py::init([](const std::string& board, int width, int height, bool stereo, bool live, int views) {
             return BoardCalibrator({board, width, height, stereo, live, views});
           }),
           py::arg("board"), py::arg("width"), py::arg("height"), py::kw_only(), py::arg("stereo") = d.stereo,
           py::arg("live") = d.live, py::arg("views") = d.views,
           "board: 'chessboard:9x6:0.025' (inner corners, side of a square [m]) or 'charuco:8x6:0.03:0.022'\n"
           "(squares, sides of square and marker [m]); width, height [px]: of the raw images; live: somebody "
           "moves\n"
           "the board, and views are taken while it rests; views: how many different ones are wanted, 10 to "
           "200.\n"
           "Raises ValueError.")
      .def(
          "look",
          [](BoardCalibrator& self, const PythonFrame& raw) {
            const py::gil_scoped_release unlocked;
            self.look(raw.view);
          },
          py::arg("raw"), "The next frame, as the camera took it. Raises ValueError when it does not fit.")
      .def_property_readonly("complete", &BoardCalibrator::complete, "Nothing is missing any more.")
      .def_property_readonly("progress", &BoardCalibrator::progress,
                             "One line for the person with the board: how far it is, and what to do next.")
      .def_property_readonly("frames", &BoardCalibrator::frames, "Looked at.")
      .def_property_readonly("found", &BoardCalibrator::found, "Of them, with the board (in both images).")
      .def_property_readonly("chosen", &BoardCalibrator::chosen, "Views kept.")
      .def("calibrate", &BoardCalibrator::calibrate, py::call_guard<py::gil_scoped_release>(),
           "Solves; seconds. Raises RuntimeError that says why a calibration is refused, and what to do.");
}

}  // namespace twofold::python
