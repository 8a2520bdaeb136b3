#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include "fixtures/rendered_scene.hpp"
#include "graph/graph_writer.hpp"
#include "graph/keyframe_proposal.hpp"
#include "loopclosure/default_vocabulary.hpp"

namespace twofold::testing {

/// A camera at x_w that looks to `yaw`.
inline SE3 pose(double yaw, const Vector3& x_w) {
  const SO3 R_c_w = SO3::exp(Vector3(0, yaw, 0));
  return SE3(R_c_w, -(R_c_w * x_w));
}

inline std::shared_ptr<const Vocabulary> vocabulary() {
  static const auto kVocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  return kVocabulary;
}

/// A camera that turns once around itself in a room and a bit more: keyframes joined one to the next.
class TurningCamera : public ::testing::Test {
 protected:
  static constexpr int kTurn = 30;  // keyframes a turn
  Rig rig_ = test_rig(SensorKind::kRgbd, 320, 240);
  GraphWriter writer_;
  GraphSnapshot graph_;

  static SE3 truth(int k) { return pose(2 * M_PI * k / kTurn, {0.2 * std::sin(0.4 * k), 0, 0}); }

  KeyframeProposal keyframe(int k, std::uint32_t room = 1) {
    static std::map<std::pair<int, std::uint32_t>, FrameImages> rendered;  // most tests take the same turn
    const auto [images, is_new] = rendered.try_emplace({k, room});
    if (is_new) RenderedScene(rig_, Vector3(3, 2, 4), room).render(truth(k), 1.5, images->second);
    KeyframeProposal proposal;
    proposal.id = KeyframeId{static_cast<std::uint32_t>(k)};
    proposal.images.copy_from(images->second);
    return proposal;
  }

  void add_to_map(int k) {
    Keyframe added;
    added.id = KeyframeId{static_cast<std::uint32_t>(k)};
    added.T_k_w = truth(k);
    added.median_depth = 3;
    writer_.add_keyframe(added);
    writer_.set_reference(added.id);
    if (k > 0) {
      Edge edge;
      edge.other = KeyframeId{static_cast<std::uint32_t>(k - 1)};
      edge.weight = 50;
      writer_.set_edge(added.id, edge);
    }
    graph_ = writer_.publish();
  }
};

}  // namespace twofold::testing
