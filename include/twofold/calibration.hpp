#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "twofold/types.hpp"

namespace twofold {

/// A lens as a calibration found it, and how well it is known: pinhole with radial-tangential distortion
/// (OpenCV's k1 k2 p1 p2). Standard deviations are one sigma.
struct CalibratedCamera {
  int width = 0, height = 0;                              ///< of the raw images [px]
  double fx = 0, fy = 0, cx = 0, cy = 0;                  ///< [px]
  double fx_std = 0, fy_std = 0, cx_std = 0, cy_std = 0;  ///< [px]
  std::array<double, 4> distortion{};                     ///< k1 k2 p1 p2
  double rms_px = 0;                                      ///< reprojection error of a corner
  double coverage = 0;  ///< share of the image in which corners were seen, 0..1
  int views = 0;        ///< that it rests on
  /// A corner of the board, and how far from where the camera model sees it it was found [px].
  struct Corner {
    double x = 0, y = 0, dx = 0, dy = 0;
  };
  std::vector<Corner> corners = {};
};

/// One camera, or a stereo pair.
struct BoardCalibration {
  std::string board;  ///< by which it was made
  CalibratedCamera left;
  std::optional<CalibratedCamera> right = {};
  Pose T_right_left = {};   ///< of a pair: between the cameras as they are, before rectification
  double baseline = 0;      ///< of a pair: length of the translation [m]
  double baseline_std = 0;  ///< likewise
  double rms_px = 0;        ///< of all corners
};

/// Writes the file that FrameRectifier, sources and `twofold run --calib` read (docs/calibration.md). Throws
/// std::runtime_error naming file and reason.
TWOFOLD_API void save_calibration(const BoardCalibration& calibration, const std::filesystem::path& file);

/// Calibrates one camera or a stereo pair from images of a printed board, as `twofold calibrate` does: keeps
/// the views that a calibration needs, says which one is missing, and refuses a result that is not to be
/// believed.
///
///   BoardCalibrator calibrator(
///       {.board = "chessboard:9x6:0.025", .width = 640, .height = 480, .stereo = true});
///   while (!calibrator.complete() && camera >> frame) {
///     calibrator.look(frame);
///     show(calibrator.progress());
///   }
///   save_calibration(calibrator.calibrate(), "camera.yaml");
///
/// Used by one thread at a time.
class TWOFOLD_API BoardCalibrator {
 public:
  struct Options {
    /// "chessboard:COLUMNSxROWS:SQUARE", inner corners and the side of a square [m], or
    /// "charuco:COLUMNSxROWS:SQUARE:MARKER[:4x4|5x5|6x6|apriltag]", squares, and the sides of both [m].
    std::string board;
    int width = 0, height = 0;  ///< of the raw images [px], > 0
    bool stereo = false;        ///< the board is looked for in both images
    bool live =
        false;  ///< somebody moves the board, before a camera or in a video: views are taken while it rests
    int views = 20;  ///< different ones that are wanted, 10 to 200

    /// Empty when valid; otherwise names the field, the rule and, where it is a number, the value.
    [[nodiscard]] TWOFOLD_API std::string invalid_reason() const;
  };

  /// Throws std::invalid_argument naming the option that makes no sense.
  explicit BoardCalibrator(const Options& options);
  ~BoardCalibrator();
  BoardCalibrator(BoardCalibrator&&) noexcept;
  BoardCalibrator& operator=(BoardCalibrator&&) noexcept;

  /// The next frame, as the camera took it: `left`, and for a pair `right`. Takes some milliseconds to some
  /// hundred. Throws std::invalid_argument when it does not fit the options.
  void look(const FrameView& raw);

  /// Nothing is missing any more. calibrate may be called before, and may then refuse.
  [[nodiscard]] bool complete() const;
  /// One line for the person with the board: how far it is, and what to do next.
  [[nodiscard]] std::string progress() const;
  [[nodiscard]] std::int64_t frames() const;  ///< looked at
  [[nodiscard]] std::int64_t found() const;   ///< of them, with the board (in both images)
  [[nodiscard]] int chosen() const;           ///< views kept

  /// Solves; seconds. Throws std::runtime_error that says why a calibration is refused, and what to do: too
  /// few views, too little of the image, all alike in tilt, corners that do not fit, a focal length or
  /// baseline that stays uncertain.
  [[nodiscard]] BoardCalibration calibrate() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace twofold
