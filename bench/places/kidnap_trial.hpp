#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/engine.hpp"
#include "synthetic/synthetic_sequence.hpp"

namespace twofold::bench {

/// A camera walks once around, is covered for two seconds, and carried elsewhere.
struct KidnapOptions {
  std::string scene = "courtyard";
  int width = 640;  ///< 4:3
  double fps = 30;
  double noise = 2;        ///< [grey levels]
  double watched_s = 2.5;  ///< after the hand is gone
};

/// Time of the walk when the lens is covered, and where in the second round, a little beside the first one's
/// line, the camera is carried to: at least four seconds of walk away from where it was.
struct Kidnapping {
  double cover_at = 0;
  double carried_to = 0;
  std::uint64_t elsewhere = 0;  ///< seed of another place, which was never mapped; 0: the mapped one
};
[[nodiscard]] Kidnapping draw_kidnapping(std::uint64_t trial, double round_seconds, bool to_unmapped_place);

struct KidnapOutcome {
  double seconds = -1;  ///< from the first frame that sees to the first with a pose in the old map; -1: none
  int frames_in_old_map = 0;  ///< of those watched
  int frames_watched = 0;
  double worst_error_m = 0;  ///< of all poses in the old map after the hand is gone; the gauge is frame 0
  double worst_error_deg = 0;
  double error_before_m = 0;  ///< of the last frame before: the map's own drift
};

/// The walk is rendered once for all trials.
class KidnapTrials {
 public:
  explicit KidnapTrials(const KidnapOptions& options);
  [[nodiscard]] double round_seconds() const { return round_seconds_; }
  [[nodiscard]] KidnapOutcome run(const Kidnapping& kidnapping);

 private:
  [[nodiscard]] synthetic::SyntheticOptions scene_options() const;
  [[nodiscard]] Frame frame(const synthetic::SyntheticSequence& sequence, int i, bool before);

  KidnapOptions options_;
  double round_seconds_ = 0;
  std::vector<Frame> walk_;
  EngineOptions engine_;
};

}  // namespace twofold::bench
