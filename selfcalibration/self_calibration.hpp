#pragma once

#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "camera/calibration.hpp"
#include "selfcalibration/clip_adjustment.hpp"

namespace twofold {

struct SelfCalibrationOptions {
  std::size_t min_clips = 4;  ///< fewer say nothing about how far to believe them, >= 2
  /// The largest standard deviation that is accepted, as a share of the focal length, > 0. Twice as much is
  /// where tracking begins to suffer.
  double max_sigma = 0.04;
  /// What no statistics see, as a share of the focal length: lenses are no polynomials of two terms, and real
  /// corners do not stay where they are on their surface. Found on recordings whose calibration is known, >=
  /// 0.
  double systematic_sigma = 0.01;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct SelfCalibration {
  SharedLens lens;
  LensVector sigma =
      LensVector::Zero();      ///< standard deviations of the lens; [0] as a share of f, without systematics
  double f_sigma = 0;          ///< of the focal length, systematics included [px]
  double readout_sigma = 0;    ///< of the readout, likewise [s]
  std::size_t clips = 0;       ///< that it rests on
  double corner_sigma_px = 0;  ///< of a corner, median over the clips
};

/// Focal length, principal point, two radial terms and readout of a camera from clips of its video, with
/// nothing known beforehand but that pixels are square and the principal point is near the centre (1.5 % of
/// the width).
///
/// Seven focal lengths from 0.4 to 2.6 widths are tried, the motion of each clip solved from two starts, and
/// the lens adjusted from the best one, the motions solved anew for each lens (variable projection; Golub and
/// Pereyra 2003): one system of both creeps where the motion hardly shows the focal length, and ends before
/// it gets there. Corners that disagree with their clip, and clips that disagree with the others, lose their
/// weight. The standard deviation is the larger one of two: from the corners, widened by how far the clips'
/// own focal lengths scatter, and from the scatter of gradients over parts of the video that do not overlap
/// (White's estimate), which sees what is wrong for all corners of a time.
///
/// Turning shows the focal length, about any axis, with or without translation. Translation alone does not,
/// in whatever direction: then the standard deviation is large.
///
/// @return  otherwise why not, in words for the person who holds the camera
[[nodiscard]] tl::expected<SelfCalibration, std::string> self_calibrate(
    const std::vector<Clip>& clips, int width, int height, const SelfCalibrationOptions& options = {});

/// As a calibration of one camera (radial-tangential distortion). With the readout where the video shows it:
/// it is adjusted together with the depths, whereas the tracker learns it from a map that it has bent before.
/// Else it stays open.
[[nodiscard]] Calibration to_calibration(const SelfCalibration& found, int width, int height);

}  // namespace twofold
