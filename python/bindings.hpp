#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <optional>

#include "twofold/estimate.hpp"

namespace twofold::python {

/// None in Python where the public face has kNoId.
inline std::optional<std::uint32_t> known_id(std::uint32_t id) {
  return id == kNoId ? std::nullopt : std::optional(id);
}

// One function a header of the public face, in the order in which they need each other.
void bind_types(pybind11::module_& module);
void bind_estimates(pybind11::module_& module);
void bind_evaluation(pybind11::module_& module);
void bind_frames(pybind11::module_& module);
void bind_calibration(pybind11::module_& module);
void bind_rectifier(pybind11::module_& module);
void bind_map(pybind11::module_& module);
void bind_surface(pybind11::module_& module);
void bind_slam(pybind11::module_& module);

}  // namespace twofold::python
