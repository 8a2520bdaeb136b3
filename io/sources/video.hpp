#pragma once

#include <filesystem>
#include <mutex>
#include <opencv2/videoio.hpp>
#include <optional>

#include "camera/rectifier.hpp"
#include "io/sources/frame_source.hpp"
#include "io/sources/source_parameters.hpp"

namespace twofold {

/// The images of a video in colour, by their numbers. A decoder of its own goes through the file once more as
/// far as it is asked for: colours kept while the frames are read would take their memory also from those who
/// want none, and the slower one of two readers would find the older ones gone. Opened when it is asked
/// first.
class VideoColours {
 public:
  explicit VideoColours(std::filesystem::path file) : file_(std::move(file)) {}
  /// CV_8UC3 (blue, green, red), as the file has it; empty where that has no colour. One before the last that
  /// was asked for: from the beginning again. Throws IoError.
  [[nodiscard]] cv::Mat image(std::int64_t index);

 private:
  std::filesystem::path file_;
  cv::VideoCapture capture_;
  std::int64_t next_ = 0;  // frames that capture_ has gone past
};

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
  [[nodiscard]] cv::Mat colour_image(std::int64_t index) const override;

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
  mutable std::mutex colours_mutex_;  ///< guards colours_: one image is decoded at a time
  mutable VideoColours colours_;
};

}  // namespace twofold
