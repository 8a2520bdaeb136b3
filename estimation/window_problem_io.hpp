#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>

#include "estimation/window_problem.hpp"

namespace twofold {

/// Text form of a WindowProblem, to take one out of a running engine and measure solvers on it. Numbers are
/// written so that reading gives the same bits. Fields are separated by blanks, '#' starts a comment:
///
///   twofold_window 1
///   rig mono|stereo|rgbd fx fy cx cy width height baseline
///   poses N            then N lines      fixed(0|1) qx qy qz qw tx ty tz          T_k_w
///   points N           then N times      anchor psi_1 psi_2 psi_3 observations
///                      with a line each  pose u_l v_l u_r information_1 .. information_3
///   constraints N      then N lines      i j qx qy qz qw tx ty tz, upper triangle of Lambda row by row (21)
void write_window_problem(std::ostream& out, const WindowProblem& problem);

/// Throws std::runtime_error that names `name`, the line and what is wrong, also for a problem that reads
/// well but is invalid.
[[nodiscard]] WindowProblem read_window_problem(std::istream& in, const std::string& name);
/// Likewise; also throws when the file cannot be opened.
[[nodiscard]] WindowProblem read_window_problem(const std::filesystem::path& file);

}  // namespace twofold
