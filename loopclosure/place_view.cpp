#include "loopclosure/place_view.hpp"

#include <cmath>

#include "imaging/guided_search.hpp"

namespace twofold {

PlaceDescriber::PlaceDescriber(const Rig& rig, const CornerSelectionOptions& options)
    : rig_(rig), selector_(options) {}

PlaceView PlaceDescriber::describe(const FrameImages& images, const Vocabulary& vocabulary) {
  PlaceView view;
  selector_.select(images.left, view.corners);
  describer_.describe(images.left, view.corners);
  view.bag = vocabulary.bag(view.corners);
  if (rig_.kind == SensorKind::kMono) return view;
  view.z.reserve(view.corners.size());
  const GuidedSearchOptions search;
  for (const DescribedCorner& corner : view.corners) {
    double u_r = Rig::kNoRight;
    if (rig_.kind == SensorKind::kRgbd) {
      u_r = right_from_depth(images.depth, rig_, corner.uv.x(), corner.uv.y());
    } else {
      const float scale = std::ldexp(1.0F, -corner.level);
      const int u = static_cast<int>(std::lround((corner.uv.x() + 0.5F) * scale - 0.5F));
      const int v = static_cast<int>(std::lround((corner.uv.y() + 0.5F) * scale - 0.5F));
      u_r = right_from_row(images, rig_, u, v, corner.level, search);
    }
    view.z.emplace_back(corner.uv.x(), corner.uv.y(), static_cast<float>(u_r));
  }
  return view;
}

}  // namespace twofold
