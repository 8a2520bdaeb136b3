#include "camera/pinhole.hpp"

#include <cmath>

namespace twofold {

PinholeCamera PinholeCamera::at_level(int level) const {
  const double s = std::ldexp(1.0, -level);
  PinholeCamera c;
  c.fx = fx * s;
  c.fy = fy * s;
  c.cx = (cx + 0.5) * s - 0.5;
  c.cy = (cy + 0.5) * s - 0.5;
  c.width = width >> level;
  c.height = height >> level;
  return c;
}

}  // namespace twofold
