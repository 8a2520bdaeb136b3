#pragma once

#include <deque>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "camera/rectifier.hpp"
#include "io/bags/bag_cameras.hpp"
#include "io/bags/bag_reader.hpp"
#include "io/files/damaged_images.hpp"
#include "io/sources/bag_image_order.hpp"
#include "io/sources/frame_source.hpp"
#include "io/sources/source_parameters.hpp"
#include "io/v4l2/pairing.hpp"

namespace twofold {

/// Images of a recording of ROS, in the order of the file and paired by the time in their headers.
///
/// Parameters: left, right, depth: names of topics (BagCameras says what is taken without); max_gap [s]
/// between the images of a pair, 0.002 for stereo, 0.016 for depth, half the interval between images if that
/// is less; camera parameters (with_parameters). The calibration is the given file's, else CameraInfo's, else
/// the parameters'. Images that cannot be decoded are left out (DamagedImages), and those whose time is out
/// of order (BagImageOrder).
class BagSource final : public FrameSource {
 public:
  /// Throws IoError.
  BagSource(std::unique_ptr<BagReader> reader, const std::filesystem::path& file,
            const std::optional<std::filesystem::path>& calibration, SourceParameters& parameters);

  [[nodiscard]] SourceReport report() const override;
  /// The frame's message is read again: frames that nobody wants in colour cost the place of theirs.
  [[nodiscard]] cv::Mat colour_image(std::int64_t index) const override;

 private:
  using Queue = std::deque<BagImage>;

  bool read(Frame& frame) override;
  [[nodiscard]] Calibration find_calibration(const std::optional<std::filesystem::path>& calibration,
                                             SourceParameters& parameters);
  /// From the CameraInfo messages; nothing when a camera has none.
  [[nodiscard]] std::optional<Calibration> recorded_calibration();
  [[nodiscard]] std::optional<CameraInfoMessage> first_info(const BagCamera& camera);
  /// Throws IoError when CameraInfo says that depth images are not the left camera's, pixel by pixel.
  void expect_registered_depth();
  /// Decodes the next image that can be decoded, into its camera's queue as soon as it is in order; false at
  /// the end.
  bool take_message();
  /// No more images come.
  void finish_order();
  /// Counts and tells the images of a camera that are out of order.
  void leave_out(const BagCamera& camera, const std::vector<std::string>& reasons);
  /// Images may get brighter than the first ones were.
  void look_at_grey_levels(const BagImage& image);
  /// The oldest images would be a pair, but it is not known yet what follows the earlier one.
  [[nodiscard]] bool next_may_be_nearer() const;
  /// The oldest pair, if both are there.
  bool take_pair(Frame& raw);
  void take_left(Frame& raw);
  /// Of a frame that was delivered; nothing for others.
  [[nodiscard]] std::optional<MessagePlace> left_place(std::int64_t index) const;
  /// What is malformed is named with the file.
  template <class Function>
  auto named(Function function) const;

  const std::filesystem::path file_;
  const std::unique_ptr<BagReader> reader_;
  BagCameras cameras_;
  PinholeCamera raw_left_;             // for its size
  std::optional<FramePairer> pairer_;  // none: one camera
  std::optional<Rectifier> rectifier_;
  std::optional<double> depth_unit_;  // [m], of depth images
  int grey_bits_ = 16;
  Queue left_, other_;
  BagImageOrder left_order_{0}, other_order_{0};
  bool ended_ = false;  // nothing is left to be read
  std::int64_t index_ = 0;
  std::uint64_t alone_ = 0;  // images without a partner
  DamagedImages damaged_, unordered_;
  std::vector<std::string> notes_, brighter_;
  mutable std::mutex places_mutex_;        // guards left_places_: next adds to them, colour_image reads them
  std::vector<MessagePlace> left_places_;  // by the frame's index
  mutable std::mutex again_mutex_;         // guards chunk_: one message is read again at a time
  mutable ChunkMemory chunk_;
};

}  // namespace twofold
