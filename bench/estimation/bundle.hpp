#pragma once

#include <vector>

#include "estimation/field_reader.hpp"
#include "estimation/window_problem.hpp"

/// What the readers of bundle_files.hpp share.
namespace twofold {

/// A bundle adjustment problem with pixels freed from distortion; cameras T_c_w [units of the file].
struct Bundle {
  Rig rig;
  std::vector<SE3> cameras;
  std::vector<Vector3> points;
  std::vector<std::vector<WindowProblem::Observation>> observations;  // by point
};

/// Anchors each point in the first camera that has it in front; leaves out what bundle_files.hpp says.
[[nodiscard]] WindowProblem to_window(const Bundle& bundle);

/// The next three fields.
[[nodiscard]] Vector3 read_vector(FieldReader& reader);

/// The two text layouts, after their header line.
[[nodiscard]] WindowProblem read_bal(FieldReader& reader, int cameras, int points, int count);
[[nodiscard]] WindowProblem read_libmv(FieldReader& reader, int cameras, int points, int count);

}  // namespace twofold
