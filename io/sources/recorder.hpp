#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "camera/calibration.hpp"
#include "camera/frame.hpp"
#include "camera/rig.hpp"

namespace twofold {

struct RecorderOptions {
  std::size_t queue_frames = 64;  ///< frames waiting to be written, >= 1; bounds the memory used
  int png_compression = 1;        ///< in [0, 9]: 1 keeps up with cameras, 9 is small

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Writes frames into a folder of EuRoC layout: mav0/cam0 (and cam1) with data/STAMP.png, data.csv,
/// sensor.yaml.
///
/// Encoding and writing happen on a thread of its own, behind a bounded queue. A line enters data.csv only
/// after its images are complete on disk under their names, so that the recording is valid up to any moment
/// at which it ends. Mono and stereo.
class Recorder {
 public:
  struct Counts {
    std::uint64_t written = 0;
    std::uint64_t refused =
        0;  ///< offered while the queue was full, or after a failure: not in the recording
    std::uint64_t queued = 0;
    std::uint64_t bytes = 0;
  };

  /// Makes the folders and sensor.yaml. Throws IoError when it cannot, or when there is a recording already.
  /// calibration: of the frames; nothing leaves sensor.yaml out, and the reader then needs one.
  Recorder(const std::filesystem::path& folder, SensorKind kind,
           const std::optional<Calibration>& calibration, const RecorderOptions& options = {});
  /// Writes what is queued.
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Queues a frame, whose images must not change any more. False, and counted: the queue is full and wait is
  /// false, or writing has failed.
  [[nodiscard]] bool offer(const Frame& frame, bool wait);
  /// Writes what is queued and ends; returns what went wrong, empty if nothing.
  [[nodiscard]] std::string finish();
  [[nodiscard]] Counts counts() const;
  [[nodiscard]] bool failed() const;

 private:
  void write_loop();
  void write_frame(const Frame& frame);
  [[nodiscard]] std::uint64_t write_image(int camera, const std::string& name, const cv::Mat& image) const;

  std::filesystem::path mav_;
  int cameras_;
  RecorderOptions options_;
  std::ofstream lists_[2];

  // mutex_ guards everything below but thread_: one frame is queued at a time, some thirty times a second.
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Frame> queue_;
  Counts counts_;
  std::string error_;
  bool ending_ = false;
  std::thread thread_;  // last: uses all of the above
};

/// The calibration under which a rig's own (rectified) images are those of ideal cameras.
[[nodiscard]] Calibration calibration_of(const Rig& rig);

}  // namespace twofold
