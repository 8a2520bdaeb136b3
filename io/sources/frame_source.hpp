#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "evaluation/trajectory.hpp"
#include "geometry/se3.hpp"
#include "geometry/triangle_mesh.hpp"

namespace twofold {

/// What became of the frames that were not delivered, and what the source goes without. Recordings lose none
/// but images that were asked to be left out for want of a partner.
struct SourceReport {
  std::uint64_t lost = 0;            ///< frames that the source knows to be missing
  std::vector<std::string> summary;  ///< a line a camera, for people
  std::vector<std::string> faults;   ///< a line a fault, in order of time; the first ones only
  std::vector<std::string>
      notes;  ///< a line each, known from the beginning: a truth that is left out, and why
};

/// Where frames come from: a recording, a video, a rendered scene, a camera.
///
/// Made by open_source (io/sources/open_source.hpp). Construction reads everything but the images and throws
/// IoError when the input cannot be used. After that nothing throws. One thread at a time.
class FrameSource {
 public:
  FrameSource() = default;
  FrameSource(const FrameSource&) = delete;
  FrameSource& operator=(const FrameSource&) = delete;
  virtual ~FrameSource() = default;

  /// The rectified rig all frames are of; constant.
  [[nodiscard]] const Rig& rig() const { return rig_; }

  /// Turns points of the left camera as it was calibrated into that which rig() and the frames are of:
  /// identity where images came rectified already, or need no turn.
  [[nodiscard]] const SO3& R_rectified_raw() const { return R_rectified_raw_; }

  /// T_w_c of the camera the rig describes, strictly increasing in time; empty when there is no ground truth.
  [[nodiscard]] const Trajectory& ground_truth() const { return ground_truth_; }

  /// Frames next will deliver in all; nothing when that is not known beforehand.
  [[nodiscard]] virtual std::optional<std::int64_t> frame_count() const { return std::nullopt; }

  /// Frames come when they are taken, not when they are asked for.
  [[nodiscard]] virtual bool is_live() const { return false; }
  /// Images are unrectified, because SourceOptions::raw asked for it; rig() states kind and size only.
  [[nodiscard]] virtual bool is_raw() const { return false; }
  [[nodiscard]] virtual SourceReport report() const { return {}; }

  /// The left image of a frame that was delivered, in colour (CV_8UC3: blue, green, red) and of the rig's
  /// size; empty where the input has no colour, or not any more. Decoded when it is asked for, so that frames
  /// which nobody wants in colour cost nothing. Any thread, beside next. Throws IoError.
  [[nodiscard]] virtual cv::Mat colour_image(std::int64_t /*index*/) const { return {}; }
  /// The surfaces that a rendered scene has, in the frame of ground_truth; nothing for other sources.
  [[nodiscard]] virtual std::optional<TriangleMesh> true_surface() const { return std::nullopt; }

  /// Fetches the next frame. Its images replace those in `frame` and are never written to again by the
  /// source; they may share memory with it, so treat them as read-only. What is delivered is checked here for
  /// every source: images are of the types camera/frame.hpp states and of the rig's size, time stamps
  /// strictly increase. After kEnd or kError the frame is unspecified and further calls repeat the answer.
  [[nodiscard]] FrameStatus next(Frame& frame);

  /// The frame that next fetches next, read now and kept for it; null at the end. For whoever has something
  /// to lose by a source that cannot deliver. Throws IoError with error().
  [[nodiscard]] const Frame* peek();

  /// One line naming the file and what is wrong with it; after kError.
  [[nodiscard]] const std::string& error() const { return error_; }

 protected:
  /// Fills index, time stamp and images; false at the end. Throws IoError.
  virtual bool read(Frame& frame) = 0;

  Rig rig_;
  SO3 R_rectified_raw_;
  Trajectory ground_truth_;

 private:
  FrameStatus status_ = FrameStatus::kFrame;
  std::int64_t last_t_ns_ = 0;
  bool any_ = false;
  std::string error_;
  std::optional<Frame> peeked_;
};

/// The next frame of a source that another one wraps; false at its end. Throws IoError with its error.
[[nodiscard]] bool next_or_throw(FrameSource& source, Frame& frame);

}  // namespace twofold
