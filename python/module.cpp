#include "python/bindings.hpp"
#include "twofold/slam.hpp"

PYBIND11_MODULE(_core, module) {
  module.doc() = "What package twofold is made of: libtwofold's classes.";
  module.attr("__version__") = twofold::version();
  twofold::python::bind_types(module);
  twofold::python::bind_estimates(module);
  twofold::python::bind_evaluation(module);
  twofold::python::bind_frames(module);
  twofold::python::bind_calibration(module);
  twofold::python::bind_rectifier(module);
  twofold::python::bind_map(module);
  twofold::python::bind_surface(module);
  twofold::python::bind_slam(module);
}
