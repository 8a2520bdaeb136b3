#pragma once

#include <filesystem>
#include <opencv2/videoio.hpp>
#include <optional>

#include "camera/rectifier.hpp"
#include "io/sources/frame_source.hpp"
#include "io/sources/source_parameters.hpp"

namespace twofold {

/// A video file: one image a frame, or with layout=side-by-side a stereo pair (left image in the left half).
///
/// Time stamps are the frame number over the frame rate (the file's, the calibration's or the parameter fps):
/// what containers say about single frames differs between decoders, and a run must not depend on that.
class VideoSource final : public FrameSource {
 public:
  /// Throws IoError.
  VideoSource(const std::filesystem::path& file, const std::optional<std::filesystem::path>& calibration,
              SourceParameters& parameters);

  /// A fault once the end was reached if the container had announced more frames.
  [[nodiscard]] SourceReport report() const override;

 private:
  bool read(Frame& frame) override;
  void take_layout(SourceParameters& parameters);
  [[nodiscard]] bool decode(Frame* raw);

  std::filesystem::path file_;
  cv::VideoCapture capture_;
  bool side_by_side_ = false;
  double fps_ = 0;
  std::optional<Rectifier> rectifier_;
  double announced_ = 0;  ///< frames, as the container says; some guess, and some say nothing
  std::int64_t index_ = 0;
  bool at_end_ = false;
};

}  // namespace twofold
