#include "tracking/loss/assumed_placements.hpp"

#include <limits>
#include <utility>

#include "base/gaussian.hpp"
#include "graph/part_extraction.hpp"
#include "graph/way_length.hpp"

namespace twofold {
namespace {

/// Two seconds at 30 Hz: a camera that was not found by then is not where it was said to be, or moved on.
constexpr int kMostTries = 60 * AssumedPlacements::kTriesAFrame;

}  // namespace

AssumedPlacements::AssumedPlacements(const GraphSnapshot& graph, const AssumedPose& assumed)
    : position_sigma_(assumed.position_sigma), angle_sigma_(assumed.angle_sigma) {
  const KeyframeId part = assumed.part == kNoKeyframe ? oldest_part(graph) : assumed.part;
  const SE3 T_c_w = assumed.T_w_c.inverse();
  double shortest = std::numeric_limits<double>::infinity();
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.culled() || keyframe.part != part) continue;
    const SE3 T_c_k = T_c_w * keyframe.T_k_w.inverse();
    const double way = way_length(keyframe, keyframe, T_c_k);
    if (way >= shortest) continue;
    shortest = way;
    assumed_ = {keyframe.id, T_c_k};
    left_ = kMostTries;
  }
}

std::optional<Placement> AssumedPlacements::next() {
  if (left_ == 0) return std::nullopt;
  --left_;
  if (std::exchange(first_, false)) return assumed_;
  Vector6 off;
  for (int i = 0; i < 6; ++i) off[i] = (i < 3 ? position_sigma_ : angle_sigma_) * gaussian(rng_);
  return Placement{assumed_.reference, SE3::exp(off) * assumed_.T_c_ref};
}

}  // namespace twofold
