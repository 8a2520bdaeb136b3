#pragma once

#include <optional>
#include <string>
#include <vector>

#include "twofold/types.hpp"
#include "viewer/scene.hpp"

namespace twofold {

enum class ViewKind : std::uint8_t {
  kLive,
  kFinished,  ///< there is a time slider, and nothing to come
  kMap        ///< likewise, and of frames nothing is known but the keyframes
};

/// What does not change while a viewer is there.
struct ViewTitle {
  std::string title = {};                ///< what is shown: a source, a map file, a folder
  std::optional<CameraRig> rig = {};     ///< frusta have its shape
  std::vector<std::string> stages = {};  ///< names of ViewLiveFrame::stage_ms
  ViewKind kind = ViewKind::kLive;
  bool metres = true;                     ///< false: lengths are of the one camera's own unit
  bool has_deviations = false;            ///< of points
  bool has_first_seen = true;             ///< points' anchors say when they were first seen
  bool has_observers = true;              ///< of points
  bool has_times = true;                  ///< of frames: how long they took
  std::vector<std::string> efforts = {};  ///< words of the effort levels, from 0 on; may be none
  bool control = false;                   ///< viewers may command
  bool keyframe_images = false;           ///< viewers may ask for images of keyframes
  std::string paced_by = {};              ///< "camera", "recording"; empty: nothing
  double period_ms = 0;                   ///< between two frames: the budget; 0: as the frames' times say
};

// JSON texts of the protocol (wire_format.hpp).
[[nodiscard]] std::string hello_text(const ViewTitle& title);
/// {"state": ...}: what holds now, however long ago it began.
[[nodiscard]] std::string state_text(const ViewScene& scene);
[[nodiscard]] std::string reasons_text(const std::vector<std::string>& reasons);
[[nodiscard]] std::string truth_text(const ViewTruth& truth);
/// Events from number `begin` on.
[[nodiscard]] std::string events_text(const ViewScene& scene, std::uint64_t begin);
/// {"status": {"ended": true, "message": ...}}: nothing new will happen.
[[nodiscard]] std::string ended_text(const std::string& message);

}  // namespace twofold
