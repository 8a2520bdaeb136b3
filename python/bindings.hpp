#pragma once

#include <pybind11/pybind11.h>

namespace twofold::python {

// One function a header of the public face, in the order in which they need each other.
void bind_types(pybind11::module_& module);
void bind_estimates(pybind11::module_& module);
void bind_evaluation(pybind11::module_& module);
void bind_frames(pybind11::module_& module);
void bind_calibration(pybind11::module_& module);
void bind_map(pybind11::module_& module);
void bind_surface(pybind11::module_& module);
void bind_slam(pybind11::module_& module);

}  // namespace twofold::python
