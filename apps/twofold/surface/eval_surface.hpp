#pragma once

#include <string>

namespace twofold {

/// What `twofold eval --surface` is told.
struct SurfaceEvalArguments {
  std::string estimate, truth;  ///< meshes, PLY
  std::string seen;             ///< mesh that completeness is asked of; empty: the truth
  bool align = true;            ///< by the trajectories beside the estimate, if they are there
  bool fit = false;             ///< then move it further, so that the surfaces fit best
  double threshold = 0.01;      ///< [m]
  std::string json, plot;       ///< files; empty: none
};

/// Compares two surfaces and prints how far they lie apart. Throws IoError.
void eval_surface(const SurfaceEvalArguments& arguments);

}  // namespace twofold
