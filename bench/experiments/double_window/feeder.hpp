#pragma once

#include "experiments/double_window/scene.hpp"
#include "graph/keyframe_proposal.hpp"
#include "graph/snapshot.hpp"

namespace twofold::bench {

enum class Association {
  kGlobal,  ///< a point of the world is one map point for ever: perfect data association
  kLocal    ///< a map point is recognised only while N1 of the reference sees it; else a new one is started
};

/// Hands the keyframes of a scene to one mapper, one after the other, as a tracker would: poses by
/// motion-only BA against the map as it stands, from a constant velocity; points start in one keyframe, by
/// disparity or, for one camera, by triangulation, and join the map with the next keyframe. Truth is not
/// looked at, save for the association and, for one camera, the motion between the first two keyframes: it
/// sets the scale.
class Feeder {
 public:
  Feeder(const Scene& scene, Association association);

  [[nodiscard]] bool done() const { return next_ == scene_.keyframes(); }
  /// Proposal of the next keyframe; valid until the next call.
  KeyframeProposal& propose(const GraphSnapshot& graph);

  /// Oldest map point of a world point that satisfies `use`; kNoPoint if there is none.
  template <class Use>
  [[nodiscard]] PointId map_point(int world, Use&& use) const {
    for (const PointId id : known_[static_cast<std::size_t>(world)]) {
      if (use(id)) return id;
    }
    return kNoPoint;
  }
  [[nodiscard]] Observation observe(PointId id, const StereoPixel& z) const;

 private:
  void associate(const GraphSnapshot& graph);
  void track(const GraphSnapshot& graph);
  void start_points();
  [[nodiscard]] bool start_value(const StereoPixel& z_previous, const StereoPixel& z, const SE3& T_previous_k,
                                 Vector3& psi) const;

  const Scene& scene_;
  Association association_;
  int next_ = 0;
  PointId free_point_{0};
  std::vector<std::vector<PointId>> known_;  ///< map points of a world point, oldest first
  std::vector<Scene::Sighting> unknown_;     ///< of this keyframe: not in the map
  SE3 T_step_;                               ///< the previous keyframe's pose relative to the one before
  KeyframeProposal proposal_;
};

}  // namespace twofold::bench
