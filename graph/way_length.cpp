#include "graph/way_length.hpp"

#include <algorithm>

namespace twofold {

double mean_depth(const Keyframe& a, const Keyframe& b) {
  return std::max(0.5 * (a.median_depth + b.median_depth), 1e-6);
}

double way_length(const Keyframe& from, const Keyframe& to, const SE3& T_to_from) {
  return T_to_from.translation().norm() / mean_depth(from, to) + T_to_from.so3().log().norm();
}

}  // namespace twofold
