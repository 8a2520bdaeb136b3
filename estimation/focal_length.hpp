#pragma once

#include <cmath>
#include <optional>

#include "estimation/window_problem.hpp"

namespace twofold {

struct FocalLengthEstimate {
  double scale = 1;  ///< of the rig's fx and fy: what they should be multiplied by
  double sigma =
      0;  ///< standard deviation of `scale`, where errors are independent and as large as residuals

  /// By more than two standard deviations.
  [[nodiscard]] bool contradicts_rig() const { return std::abs(scale - 1) > 2 * sigma; }
};

/// The focal length that the measurements of one camera say themselves: eq. 6.4 with the scale of fx and fy
/// as one unknown more, by Gauss-Newton from the rig's. The principal point is taken to be right.
///
/// `problem` must be bundle adjustment that WindowSolver has solved, with one fixed pose; right coordinates
/// are left out of account. Where the rig's focal length is off by less than `enough`, or the standard
/// deviation is larger, one linearisation is all that it costs, and the problem stays as it is; otherwise it
/// is solved with the estimated focal length, which its rig has then.
///
/// @param enough  > 0, a share of the focal length
/// @return  nothing where the motion does not show it: the system is singular, or no minimum was found
[[nodiscard]] std::optional<FocalLengthEstimate> estimate_focal_length(WindowProblem& problem,
                                                                       const WindowSolverOptions& options,
                                                                       double enough);

}  // namespace twofold
