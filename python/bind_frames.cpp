#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <optional>
#include <string>

#include <fmt/format.h>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/frames.hpp"
#include "python/trajectory.hpp"

namespace twofold::python {
namespace {

ImageFormat colour_format(const std::string& colours) {
  if (colours == "bgr") return ImageFormat::kBgr8;
  if (colours == "rgb") return ImageFormat::kRgb8;
  throw py::value_error("colours must be 'bgr' or 'rgb', is '" + colours + "'");
}

PythonFrame make_frame(std::int64_t t_ns, const py::object& left, const py::object& right,
                       const py::object& depth, const std::string& colours) {
  release_arrays();
  PythonFrame frame;
  auto owner = std::make_unique<ArrayOwner>();
  const ImageFormat format = colour_format(colours);
  frame.view.t_ns = t_ns;
  frame.view.left = image_view(left, "left", format, *owner, frame.copied);
  frame.view.right = image_view(right, "right", format, *owner, frame.copied);
  frame.view.depth = image_view(depth, "depth", ImageFormat::kDepth16, *owner, frame.copied);
  frame.view.owner = ArrayOwner::share(std::move(owner));
  return frame;
}

template <ImageView FrameView::*kImage>
py::object image_of(const py::object& self) {
  return array_of(self.cast<const PythonFrame&>().view.*kImage, self);
}

void bind_frame(py::module_& module) {
  py::class_<PythonFrame>(module, "Frame",
                          "The images of one instant.\n\n"
                          "Grey images (uint8, height x width) and depth (uint16, likewise) are used where "
                          "they are: do not write into\n"
                          "them afterwards. Depth in metres (float32) is rounded to CameraRig.depth_unit in "
                          "a copy. Colour (uint8, height x width x 3) is turned to grey, a copy, "
                          "when the frame is pushed. An\n"
                          "array whose rows do not lie row after row, pixel beside pixel (a transposed or "
                          "mirrored one), is copied here;\n"
                          "`copied` names it.")
      .def(py::init(&make_frame), py::arg("t_ns"), py::arg("left"), py::arg("right") = py::none(),
           py::arg("depth") = py::none(), py::kw_only(), py::arg("colours") = "bgr",
           "t_ns [ns] must grow from frame to frame; colours: order in colour images, 'bgr' or 'rgb'.")
      .def_property_readonly(
          "t_ns", [](const PythonFrame& frame) { return frame.view.t_ns; }, "When it was taken [ns].")
      .def_property_readonly("left", &image_of<&FrameView::left>,
                             "A read-only view of the pixels: (height, width) uint8, or (height, width, 3).")
      .def_property_readonly("right", &image_of<&FrameView::right>, "The same, or None.")
      .def_property_readonly(
          "depth", &image_of<&FrameView::depth>,
          "(height, width) uint16 in units of CameraRig.depth_unit, or float32 [m], read-only; or None.")
      .def_property_readonly(
          "copied", [](const PythonFrame& frame) { return py::tuple(py::cast(frame.copied)); },
          "Names of the images that were copied when the frame was made.");
}

std::optional<PythonFrame> next_frame(Source& source) {
  PythonFrame frame;
  const py::gil_scoped_release unlocked;
  if (!source.next(frame.view)) return std::nullopt;
  return frame;
}

void bind_source(py::module_& module) {
  py::class_<Source, std::shared_ptr<Source>>(
      module, "Source",
      "Frames of a recording, a video, a rendered scene or a camera, rectified.\n\n"
      "Named as on the command line: a path, or kitti:DIR, euroc:DIR, tum:DIR, 7scenes:DIR, replica:DIR, "
      "scannet:DIR,\n"
      "images:DIR, video:FILE, mcap:FILE, bag:FILE, v4l2:DEVICE, synthetic:SCENE, with "
      "?key=value&key=value.\n"
      "Iterating gives Frames; the interpreter runs on meanwhile.")
      .def(
          py::init([](const std::filesystem::path& name,
                      const std::optional<std::filesystem::path>& calibration, bool preload, bool left_only) {
            const py::gil_scoped_release unlocked;
            return std::make_shared<Source>(name.string(),
                                            SourceSettings{calibration.value_or(""), preload, left_only});
          }),
          py::arg("name"), py::kw_only(), py::arg("calibration") = py::none(), py::arg("preload") = false,
          py::arg("left_only") = false,
          "calibration: file instead of the recording's own; preload: decode everything now; left_only: the "
          "left camera alone, as Sensor.MONO. Raises RuntimeError.")
      .def_property_readonly("rig", &Source::rig, py::return_value_policy::copy,
                             "CameraRig of all frames: size [px], focal lengths [px], baseline [m].")
      .def_property_readonly(
          "T_rectified_raw", &Source::T_rectified_raw,
          "Pose, a rotation alone, of the calibrated left camera in the one that poses are of, by the "
          "calibration this\nsource uses; the identity where images come as they were: T_world_raw = "
          "pose.T_world_camera @ source.T_rectified_raw.")
      .def_property_readonly("frame_count", &Source::frame_count, "None where it is not known beforehand.")
      .def_property_readonly("is_live", &Source::is_live,
                             "Frames come when they are taken, not when asked for.")
      .def_property_readonly(
          "ground_truth", [](const Source& source) { return PoseList{source.ground_truth()}; },
          "Trajectory of the rig's camera; empty when there is none.")
      .def("next", &next_frame,
           "The next frame, or None at the end. Any thread: those that ask at once take turns.")
      .def(
          "in_colour",
          [](const Source& self, const PythonFrame& frame) {
            const py::gil_scoped_release unlocked;
            return PythonFrame{self.in_colour(frame.view), {}};
          },
          py::arg("frame"),
          "A frame that this source gave, with its left image in colour (blue, green, red) if the recording "
          "has "
          "it, else as it is:\nfor SurfaceModel.add and MapSurface.add. Decoded when it is asked for. Raises "
          "RuntimeError when the input breaks.")
      .def("stop", &Source::stop, "A camera ends; of recordings, no more frames are given. From any thread.")
      .def("__iter__", [](const py::object& self) { return self; })
      .def("__next__",
           [](Source& source) {
             auto frame = next_frame(source);
             if (!frame) throw py::stop_iteration();
             return *std::move(frame);
           })
      .def("__repr__",
           [](const Source& source) {
             const auto count = source.frame_count();
             return fmt::format("<Source{}: {}>", count ? fmt::format(" of {} frames", *count) : "",
                                py::repr(py::cast(source.rig())).cast<std::string>());
           })
      .def("__enter__", [](const py::object& self) { return self; })
      .def("__exit__", [](Source& source, const py::args&) { source.stop(); });
}

}  // namespace

void bind_frames(py::module_& module) {
  bind_frame(module);
  bind_source(module);
}

}  // namespace twofold::python
