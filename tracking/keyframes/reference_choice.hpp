#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "tracking/common/local_map.hpp"
#include "tracking/keyframes/options.hpp"
#include "tracking/search/local_map_search.hpp"

namespace twofold {

/// Chooses the keyframe of N1 that sees most of what is tracked as the new reference: when the camera comes
/// back to a place, the reference comes back too, and no keyframe is needed (thesis 6.2.2: V_ref may be an
/// older, revisited keyframe). No allocation after construction.
class ReferenceChoice {
 public:
  /// @param max_points  found in a frame at most
  ReferenceChoice(const ReferenceChoiceOptions& options, std::size_t max_points) : options_(options) {
    found_.reserve(max_points);
  }

  /// Counts frames: a better keyframe is looked for in some of them only.
  void begin_frame() { ++frames_; }
  /// @param reference  the present one, which the graph has; the local map is the one around it
  /// @return a keyframe that is clearly better, if one is looked for in this frame
  [[nodiscard]] std::optional<KeyframeId> better(const GraphSnapshot& graph, KeyframeId reference,
                                                 const LocalMap& local_map, const SearchOutcome& found);

 private:
  [[nodiscard]] int shared(const GraphSnapshot& graph, KeyframeId id) const;

  ReferenceChoiceOptions options_;
  std::uint32_t frames_ = 0;
  std::vector<PointId> found_;  ///< sorted
};

}  // namespace twofold
