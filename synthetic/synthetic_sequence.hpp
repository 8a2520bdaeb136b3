#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "synthetic/image_effects.hpp"
#include "synthetic/options.hpp"
#include "synthetic/renderer.hpp"
#include "synthetic/scenes.hpp"

namespace twofold::synthetic {

/// A rendered recording with exact ground truth. Frames are numbered 0 .. frame_count() - 1 here; lost frames
/// are not counted but leave a gap in Frame::index. Rendering is const and may be called from several
/// threads; the same options give the same bytes.
class SyntheticSequence {
 public:
  /// Throws std::invalid_argument with options.invalid_reason().
  explicit SyntheticSequence(const SyntheticOptions& options);

  [[nodiscard]] int frame_count() const { return static_cast<int>(indices_.size()); }
  [[nodiscard]] const Rig& rig() const { return rig_; }
  [[nodiscard]] std::int64_t index(int i) const { return indices_[i]; }
  [[nodiscard]] std::int64_t t_ns(int i) const;
  /// The place that is rendered, without what moves and without the other place a camera is carried to.
  [[nodiscard]] const Scene& scene() const { return staging_.scene; }
  /// Pose of the left camera in the middle of the exposure; elsewhere, of that place. Without meaning while
  /// the lens is covered.
  [[nodiscard]] SE3 T_w_c(int i) const;
  [[nodiscard]] bool covered(int i) const;
  /// The lens is not covered, and the camera is where it started.
  [[nodiscard]] bool in_first_place(int i) const;

  /// The images as the sensor delivers them.
  [[nodiscard]] Frame render(int i) const;
  /// The left view without noise, gain or blur, with exact depth; each row as it is exposed.
  [[nodiscard]] View exact_view(int i) const;

 private:
  [[nodiscard]] double seconds(int i) const;
  [[nodiscard]] bool carried(int i) const;
  /// Time in the walk that frame i shows.
  [[nodiscard]] double walk_seconds(int i) const;
  [[nodiscard]] const Staging& staging(int i) const {
    return carried(i) && elsewhere_ ? *elsewhere_ : staging_;
  }
  /// What is before a camera shifted by right_m along the rig's x axis, at time t of the walk.
  [[nodiscard]] Instant instant_at(const Staging& staging, double t, double right_m) const;
  /// Its view, of which t is the middle of the exposure.
  [[nodiscard]] View view_at(const Staging& staging, double t, double right_m) const;
  [[nodiscard]] cv::Mat blurred(int i, double right_m) const;
  [[nodiscard]] double gain(int i) const;
  [[nodiscard]] Frame behind_hand(Frame frame, const NoiseKey& left, const NoiseKey& right) const;

  SyntheticOptions options_;
  Rig rig_;             ///< as its calibration has it
  PinholeCamera lens_;  ///< as it is
  Staging staging_;
  std::optional<Staging> elsewhere_;
  std::vector<std::int64_t> indices_;
};

}  // namespace twofold::synthetic
