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
/// Time stamps are what the file says of each frame, counted from the first one: telephones take fewer frames
/// a second in poor light. With the parameter fps they are the frame's number over that rate.
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
  [[nodiscard]] std::int64_t time_stamp();

  std::filesystem::path file_;
  cv::VideoCapture capture_;
  bool side_by_side_ = false;
  bool at_fixed_rate_ = false;  ///< fps_, whatever the file says of its frames
  double fps_ = 0;              ///< else where the file says nothing
  std::optional<Rectifier> rectifier_;
  double announced_ = 0;  ///< frames, as the container says; some guess, and some say nothing
  std::int64_t index_ = 0;
  std::int64_t first_t_ns_ = 0;    ///< as the file has it
  std::int64_t last_t_ns_ = 0;     ///< as it was given out
  std::int64_t without_time_ = 0;  ///< frames
  bool at_end_ = false;
};

}  // namespace twofold
