#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "camera/calibration.hpp"
#include "camera/rectifier.hpp"
#include "io/files/damaged_images.hpp"
#include "io/sources/frame_source.hpp"
#include "io/sources/source_parameters.hpp"

namespace twofold {

/// Image files of one instant.
struct RecordedFrame {
  std::int64_t t_ns = 0;
  std::filesystem::path left;
  std::filesystem::path right;  ///< stereo, else empty
  std::filesystem::path depth;  ///< RGB-D, else empty
};

/// A folder of image files, read but for the images.
struct Recording {
  std::filesystem::path folder;
  std::filesystem::path calibration_file;  ///< named in messages about the calibration
  Calibration calibration;                 ///< a size of 0 x 0 is taken from the first image
  bool left_only = false;             ///< nobody looks at right and depth images, which need not be there
  std::vector<RecordedFrame> frames;  ///< t_ns strictly increasing
  FrameRange range;                   ///< of these, what is played
  Trajectory ground_truth;            ///< T_w_c of the raw left camera
  std::uint64_t alone = 0;            ///< images that were left out for want of a partner
  std::vector<std::string> notes;     ///< SourceReport::notes
};

/// The reader of one layout: a folder to a Recording. `calibration` overrides the file in the folder.
/// All throw IoError.
[[nodiscard]] Recording read_kitti_recording(const std::filesystem::path& folder,
                                             const std::optional<std::filesystem::path>& calibration,
                                             SourceParameters& parameters);
[[nodiscard]] Recording read_euroc_recording(const std::filesystem::path& folder,
                                             const std::optional<std::filesystem::path>& calibration,
                                             SourceParameters& parameters);
[[nodiscard]] Recording read_tum_recording(const std::filesystem::path& folder,
                                           const std::optional<std::filesystem::path>& calibration,
                                           SourceParameters& parameters);
[[nodiscard]] Recording read_seven_scenes(const std::filesystem::path& folder,
                                          const std::optional<std::filesystem::path>& calibration,
                                          SourceParameters& parameters);
[[nodiscard]] Recording read_replica(const std::filesystem::path& folder,
                                     const std::optional<std::filesystem::path>& calibration,
                                     SourceParameters& parameters);
[[nodiscard]] Recording read_scannet(const std::filesystem::path& folder,
                                     const std::optional<std::filesystem::path>& calibration,
                                     SourceParameters& parameters);
[[nodiscard]] Recording read_image_folder(const std::filesystem::path& folder,
                                          const std::optional<std::filesystem::path>& calibration,
                                          SourceParameters& parameters);

/// A file of EuRoC's form as FOLDER/state_groundtruth_estimate0/data.csv, as the poses of the rectified left
/// camera that the source euroc:FOLDER has. Nothing when FOLDER/cam0/sensor.yaml does not say how that sits
/// in the body. Throws IoError when a file that is there cannot be read.
[[nodiscard]] std::optional<Trajectory> read_euroc_truth_of_camera(const std::filesystem::path& file);

/// Lays the parameters fx fy cx cy baseline (RGB-D: virtual) depth_scale (units a metre) depth_min depth_max
/// over `base`. When `base` was not read from a file, the intrinsics and, for stereo, the baseline must be
/// given. Where only the left camera is wanted, and nothing is known of a right one, it is of one camera.
[[nodiscard]] Calibration with_parameters(Calibration base, bool from_file, SensorKind kind,
                                          SourceParameters& parameters);

/// Notes when the frames are so far apart that `file`, which gives their times in seconds, may have them in
/// another unit.
void note_long_intervals(const std::filesystem::path& file, Recording& recording);

/// Sets ground_truth to what `read` returns. No run needs one: where it throws IoError, a note says why, and
/// the recording goes without.
void take_truth(const std::function<Trajectory()>& read, Recording* recording);

/// T_w_c with the camera turned from raw to rectified axes.
[[nodiscard]] Trajectory rectified_trajectory(const Trajectory& raw, const SO3& R_rectified_raw);

/// Plays a Recording: decodes, checks sizes, rectifies where the calibration asks for it. Frames with files
/// that cannot be read are left out (DamagedImages).
class PlaybackSource final : public FrameSource {
 public:
  /// Throws IoError when the calibration is invalid or none of the first images decodes.
  explicit PlaybackSource(Recording recording);
  [[nodiscard]] std::optional<std::int64_t> frame_count() const override {
    return static_cast<std::int64_t>(end_) - recording_.range.first;
  }
  [[nodiscard]] SourceReport report() const override;
  [[nodiscard]] cv::Mat colour_image(std::int64_t index) const override;
  /// The rectified left image of the frame with that time stamp, in colour if it has any, else grey; empty
  /// when there is no such frame. Any thread. Throws IoError.
  [[nodiscard]] cv::Mat left_image(std::int64_t t_ns) const;

 private:
  bool read(Frame& frame) override;
  [[nodiscard]] SensorKind kind() const;  ///< of the images that are looked at
  /// The first left image that can be read; those before it are left out.
  [[nodiscard]] cv::Mat first_image();
  /// Gives the calibration the sizes that it lacks.
  void take_size(const cv::Mat& first);
  [[nodiscard]] Frame decode(const RecordedFrame& files) const;
  /// Of a frame that cannot be read because of `error`. Throws IoError where a whole folder is missing: that
  /// is no gap.
  void leave_out(const RecordedFrame& files, const IoError& error);
  void expect_sizes(const RecordedFrame& files, const Frame& frame) const;
  /// The next frame that can be read, not rectified; false at the end. Throws IoError.
  [[nodiscard]] bool read_raw(Frame& raw);
  [[nodiscard]] cv::Mat rectified_left(const std::filesystem::path& file, const cv::Mat& raw) const;

  Recording recording_;
  std::optional<Rectifier> rectifier_;
  int grey_bits_ = 16;                        ///< of images of 16 bits
  std::string left_said_by_, right_said_by_;  ///< the sizes of these cameras (expect_size)
  std::size_t next_ = 0, end_ = 0;
  DamagedImages damaged_;
  std::uint64_t missing_ = 0;  ///< of the frames that damaged_ counts: an image is not there
};

}  // namespace twofold
