#pragma once

#include <array>
#include <string>

#include "twofold/types.hpp"

namespace twofold::python {

/// A pose of numbers that somebody gave, its quaternion of length 1: what is within 0.01 of that, as in files
/// of few decimals or of float32, is normalised. Throws py::value_error for others and for what is not
/// finite, which begins with `where` ("row 3: ").
[[nodiscard]] Pose checked_pose(const std::array<double, 3>& t, const std::array<double, 4>& q,
                                const std::string& where);

}  // namespace twofold::python
