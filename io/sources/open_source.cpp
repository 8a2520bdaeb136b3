#include "io/sources/open_source.hpp"

#include <functional>
#include <map>

#include <fmt/format.h>

#include "io/bags/bag_reader.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/bag_source.hpp"
#include "io/sources/layouts/recognise_layout.hpp"
#include "io/sources/left_camera_source.hpp"
#include "io/sources/preloaded_source.hpp"
#include "io/sources/recording.hpp"
#include "io/sources/source_parameters.hpp"
#include "io/sources/v4l2_source.hpp"
#include "io/sources/video.hpp"

#include "io/sources/synthetic_source.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

using Opener = std::function<std::unique_ptr<FrameSource>(const SourceSpec&, const SourceOptions&)>;
using RecordingReader = Recording (*)(const fs::path&, const std::optional<fs::path>&, SourceParameters&);

/// Readers of folders of image files.
const std::map<std::string, RecordingReader>& readers() {
  static const std::map<std::string, RecordingReader> kReaders{
      {"kitti", read_kitti_recording}, {"euroc", read_euroc_recording}, {"tum", read_tum_recording},
      {"7scenes", read_seven_scenes},  {"replica", read_replica},       {"scannet", read_scannet},
      {"images", read_image_folder}};
  return kReaders;
}

std::unique_ptr<PlaybackSource> open_folder(RecordingReader read, const SourceSpec& spec,
                                            const SourceOptions& options) {
  expect_folder(spec.argument);
  SourceParameters parameters(spec.text, spec.parameters, options.suppose_camera, options.left_only);
  Recording recording = read(spec.argument, options.calibration, parameters);
  recording.left_only = options.left_only;
  recording.range = parameters.take_range();
  parameters.expect_all_taken();
  return std::make_unique<PlaybackSource>(std::move(recording));
}

Opener recording_opener(const std::string& scheme) {
  return [read = readers().at(scheme)](const SourceSpec& spec,
                                       const SourceOptions& options) -> std::unique_ptr<FrameSource> {
    return open_folder(read, spec, options);
  };
}

/// Some of another source's frames, which keep their numbers and times. Those before are read and dropped:
/// for recordings that can only be read from their beginning.
class RangedSource final : public FrameSource {
 public:
  RangedSource(std::unique_ptr<FrameSource> source, const FrameRange& range, std::string file)
      : source_(std::move(source)), range_(range), file_(std::move(file)) {
    rig_ = source_->rig();
    R_rectified_raw_ = source_->R_rectified_raw();
  }
  [[nodiscard]] SourceReport report() const override { return source_->report(); }
  [[nodiscard]] cv::Mat colour_image(std::int64_t index) const override {
    return source_->colour_image(index);
  }

 private:
  bool read(Frame& frame) override {
    do {
      if (taken_ - range_.first >= range_.most) return false;
      if (!next_or_throw(*source_, frame)) {
        range_.expect_within(file_, taken_);
        return false;
      }
    } while (taken_++ < range_.first);
    return true;
  }

  std::unique_ptr<FrameSource> source_;  // without truth: no video or bag has one
  const FrameRange range_;
  const std::string file_;
  std::int64_t taken_ = 0;  // of source_, the dropped ones, too
};

std::unique_ptr<FrameSource> only_range(std::unique_ptr<FrameSource> source, const FrameRange& range,
                                        const std::string& file) {
  if (range.is_whole()) return source;
  return std::make_unique<RangedSource>(std::move(source), range, file);
}

std::unique_ptr<FrameSource> open_video(const SourceSpec& spec, const SourceOptions& options) {
  std::error_code error;
  if (!fs::is_regular_file(spec.argument, error)) throw IoError(spec.argument, "no such video file");
  expect_no_sqlite_bag(spec.argument);
  SourceParameters parameters(spec.text, spec.parameters, options.suppose_camera, options.left_only);
  const FrameRange range = parameters.take_range();
  auto source = std::make_unique<VideoSource>(spec.argument, options.calibration, parameters);
  parameters.expect_all_taken();
  return only_range(std::move(source), range, spec.argument);
}

Opener bag_opener(std::unique_ptr<BagReader> (*open)(const fs::path&)) {
  return [open](const SourceSpec& spec, const SourceOptions& options) -> std::unique_ptr<FrameSource> {
    expect_no_sqlite_bag(spec.argument);
    SourceParameters parameters(spec.text, spec.parameters, options.suppose_camera, options.left_only);
    const FrameRange range = parameters.take_range();
    auto source =
        std::make_unique<BagSource>(open(spec.argument), spec.argument, options.calibration, parameters);
    parameters.expect_all_taken();
    return only_range(std::move(source), range, spec.argument);
  };
}

const std::map<std::string, Opener>& openers() {
  static const std::map<std::string, Opener> kOpeners{
      {"kitti", recording_opener("kitti")},
      {"euroc", recording_opener("euroc")},
      {"tum", recording_opener("tum")},
      {"7scenes", recording_opener("7scenes")},
      {"replica", recording_opener("replica")},
      {"scannet", recording_opener("scannet")},
      {"images", recording_opener("images")},
      {"video", open_video},
      {"mcap", bag_opener(open_mcap)},
      {"bag", bag_opener(open_rosbag)},
      {"v4l2",
       [](const SourceSpec& spec, const SourceOptions& options) -> std::unique_ptr<FrameSource> {
         return std::make_unique<V4l2Source>(spec, options);
       }},
      {"synthetic",
       [](const SourceSpec& spec, const SourceOptions& options) {
         if (options.calibration)
           throw IoError(*options.calibration, "is not asked for: a rendered scene has its calibration");
         return open_synthetic(spec.argument, spec.parameters);
       }},
  };
  return kOpeners;
}

std::string known_schemes() {
  std::string names;
  for (const auto& [name, opener] : openers()) names += (names.empty() ? "" : ", ") + name;
  return names;
}

}  // namespace

std::unique_ptr<PlaybackSource> open_recording(const std::string& text,
                                               const std::optional<fs::path>& calibration) {
  const SourceSpec spec = parse_source_spec(text);
  std::error_code error;
  if (spec.scheme.empty() && !fs::is_directory(spec.argument, error)) return nullptr;
  const auto reader = readers().find(spec.scheme.empty() ? recognise_layout(spec.argument) : spec.scheme);
  if (reader == readers().end()) return nullptr;
  SourceOptions options;
  options.calibration = calibration;
  options.left_only = true;
  return open_folder(reader->second, spec, options);
}

std::unique_ptr<FrameSource> open_source(const std::string& text, const SourceOptions& options) {
  const SourceSpec spec = parse_source_spec(text);
  const std::string scheme = spec.scheme.empty() ? recognise_layout(spec.argument) : spec.scheme;
  const auto opener = openers().find(scheme);
  if (opener == openers().end()) {
    throw IoError(text, fmt::format("unknown kind of source '{}' (known: {})", scheme, known_schemes()));
  }
  auto source = opener->second(spec, options);
  if (options.left_only && source->rig().kind != SensorKind::kMono) {
    source = std::make_unique<LeftCameraSource>(std::move(source));
  }
  if (options.preload && source->is_live()) throw IoError(text, "a camera cannot be preloaded");
  if (options.preload) source = std::make_unique<PreloadedSource>(std::move(source));
  return source;
}

}  // namespace twofold
