#include "loopclosure/described_place.hpp"

#include "imaging/guided_search.hpp"

namespace twofold {

PlaceDescriber::PlaceDescriber(const Rig& rig, const CornerSelectionOptions& options)
    : rig_(rig), selector_(options) {}

DescribedPlace PlaceDescriber::describe(const FrameImages& images, const Vocabulary& vocabulary) {
  DescribedPlace view;
  selector_.select(images.left, view.corners);
  describer_.describe(images.left, view.corners);
  view.bag = vocabulary.bag(view.corners);
  if (rig_.kind == SensorKind::kMono) return view;
  view.pixels.reserve(view.corners.size());
  const GuidedSearchOptions search;
  for (const DescribedCorner& corner : view.corners) {
    const double u_r = right_of_corner(images, rig_, corner.uv.cast<double>(), corner.level, search);
    view.pixels.emplace_back(corner.uv.x(), corner.uv.y(), static_cast<float>(u_r));
  }
  return view;
}

}  // namespace twofold
