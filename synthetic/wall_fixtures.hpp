#pragma once

#include "synthetic/canvas.hpp"

namespace twofold::synthetic {

/// What hangs on walls and grows up them, drawn differently for each state of `random`. Sizes in metres.

void draw_window(Canvas& canvas, Random& random, double x, double y, double w, double h);
void draw_door(Canvas& canvas, Random& random, double x, double y, double w, double h);
void draw_poster(Canvas& canvas, Random& random, double x, double y, double w, double h);
void draw_ivy(Canvas& canvas, Random& random, double x, double y, double radius);

/// Panels of walls that lose what is painted on them: each is then of its mean grey. They are spread evenly,
/// so that a camera near a wall sees a painted one beside them.
struct PlainPanels {
  static constexpr double kWidth = 1.2;  ///< [m]
  std::uint64_t seed = 1;                ///< says where they begin
  double share = 0;                      ///< of a wall's panels, 0 .. 1

  /// @param wall  its number; others begin elsewhere
  void paint(Canvas& canvas, std::uint64_t wall) const;
};

/// A whole wall, in one of four styles (0 .. 3): windows above, doors, posters and ivy below.
void paint_facade(Canvas& canvas, Random& random, int style);

}  // namespace twofold::synthetic
