#pragma once

#include "synthetic/canvas.hpp"

namespace twofold::synthetic {

/// What hangs on walls and grows up them, drawn differently for each state of `random`. Sizes in metres.

void draw_window(Canvas& canvas, Random& random, double x, double y, double w, double h);
void draw_door(Canvas& canvas, Random& random, double x, double y, double w, double h);
void draw_poster(Canvas& canvas, Random& random, double x, double y, double w, double h);
void draw_ivy(Canvas& canvas, Random& random, double x, double y, double radius);

/// A whole wall, in one of four styles (0 .. 3): windows above, doors, posters and ivy below.
void paint_facade(Canvas& canvas, Random& random, int style);

}  // namespace twofold::synthetic
