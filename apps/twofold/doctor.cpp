#include <CLI/CLI.hpp>
#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "apps/twofold/commands.hpp"
#include "base/median.hpp"
#include "doctor/camera.hpp"
#include "doctor/depth_images.hpp"
#include "doctor/disk.hpp"
#include "doctor/machine.hpp"
#include "doctor/stereo_rows.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/v4l2_frames.hpp"

namespace twofold {
namespace {

struct DoctorArguments {
  std::string source, folder, calibration;
  std::string root = "/";
};

/// One image stream to look at, and what recording it takes.
struct Wanted {
  std::vector<CameraOptions> cameras;
  double bytes_per_second = 2 * 640 * 480 * 30;  // a small stereo camera, when no source says more
};

CaptureFormat with_defaults(CaptureFormat format) {
  if (format.width == 0) format = {format.format, 640, 480, format.fps};
  if (format.fps <= 0) format.fps = 30;
  return format;
}

Wanted wanted_of(const std::string& text) {
  Wanted wanted;
  if (text.empty()) return wanted;
  const SourceSpec spec = parse_source_spec(text);
  if (!spec.is_camera()) return wanted;
  SourceParameters parameters(text, spec.parameters);
  const V4l2FramesOptions options = take_v4l2_options(spec.argument, parameters);
  wanted.cameras.push_back(options.first);
  if (options.second) wanted.cameras.push_back(*options.second);
  wanted.bytes_per_second = 0;
  for (CameraOptions& camera : wanted.cameras) {
    camera.format = with_defaults(camera.format);
    const bool depth = camera.format.format == PixelFormat::kZ16;  // the others are recorded in grey
    wanted.bytes_per_second +=
        stream_bytes_per_second(depth ? PixelFormat::kZ16 : PixelFormat::kGrey, camera.format.width,
                                camera.format.height, camera.format.fps);
  }
  return wanted;
}

SourceOptions source_options(const DoctorArguments& arguments) {
  SourceOptions options;
  if (!arguments.calibration.empty()) options.calibration = arguments.calibration;
  return options;
}

void print(const Finding& finding) {
  static constexpr std::array kNames{"ok", "warn", "bad"};
  fmt::print("{:<4}  {:<15} {}\n", kNames[static_cast<std::size_t>(finding.health)], finding.subject,
             finding.state);
  if (!finding.remedy.empty()) fmt::print("      {:<15} -> {}\n", "", finding.remedy);
}

/// What recording such frames takes: their images, packed by nothing.
double bytes_per_second(const Rig& rig, double fps) {
  const int bytes_per_pixel = rig.kind == SensorKind::kStereo ? 2 : rig.kind == SensorKind::kRgbd ? 3 : 1;
  return bytes_per_pixel * fps * rig.camera.width * rig.camera.height;
}

/// Of a recording at its own pace, by its first frames' times.
double recorded_bytes_per_second(const DoctorArguments& arguments) {
  constexpr std::size_t kFrames = 30;
  constexpr double kUsualFps = 30;  // when a single frame says nothing
  const auto source = open_source(arguments.source, source_options(arguments));
  std::vector<std::int64_t> intervals;
  Frame frame;
  std::optional<std::int64_t> last_ns;
  while (intervals.size() < kFrames && source->next(frame) == FrameStatus::kFrame) {
    if (last_ns) intervals.push_back(frame.t_ns - *last_ns);
    last_ns = frame.t_ns;
  }
  const std::int64_t usual = median(std::span(intervals));
  return bytes_per_second(source->rig(), usual > 0 ? 1e9 / static_cast<double>(usual) : kUsualFps);
}

/// What became of the images that were asked for.
Finding check_images(const FrameSource& source) {
  const std::string subject = "images", remedy = source.is_live() ? "" : "copy the recording anew";
  if (!source.error().empty()) return {Health::kBad, subject, source.error(), remedy};
  const std::vector<std::string> faults = source.report().faults;
  if (faults.empty()) return {Health::kOk, subject, "can be read", ""};
  const std::string others =
      faults.size() > 1 ? fmt::format(", and {} other{}", faults.size() - 1, faults.size() > 2 ? "s" : "")
                        : "";
  return {Health::kWarn, subject, faults.front() + others, remedy};
}

/// What is told of images beside that they can be read.
class ImageChecks {
 public:
  explicit ImageChecks(const Rig& rig) : rig_(rig) {
    if (rig.kind == SensorKind::kStereo) meter_.emplace(rig, kCorners);
  }

  void look_at(const Frame& frame) {
    if (meter_) {
      if (const auto offset = meter_->search(frame.left, frame.right)) offsets_.push_back(*offset);
    }
    if (rig_.kind == SensorKind::kRgbd) depths_.push_back(frame.depth.clone());
  }
  /// After at least one look.
  [[nodiscard]] std::vector<Finding> findings() const {
    switch (rig_.kind) {
      case SensorKind::kStereo:
        return {check_rows(offsets_)};
      case SensorKind::kRgbd:
        return {check_depth(depths_, rig_)};
      case SensorKind::kMono:
        break;
    }
    return {};
  }

 private:
  static constexpr int kCorners = 160;
  const Rig rig_;
  std::optional<RowOffsetMeter> meter_;
  std::vector<RowOffset> offsets_;
  std::vector<cv::Mat> depths_;
};

/// Looks at some frames of a recording, or of a camera whose calibration is known.
std::vector<Finding> look_at_images(const DoctorArguments& arguments) {
  constexpr int kLooks = 5;
  constexpr int kApart = 5;  // frames
  if (arguments.source.empty()) return {};
  if (arguments.calibration.empty() && parse_source_spec(arguments.source).is_camera()) return {};
  const auto source = open_source(arguments.source, source_options(arguments));
  ImageChecks checks(source->rig());
  Frame frame;
  FrameStatus status = FrameStatus::kFrame;
  int frames = 0;
  for (; frames < kLooks * kApart && (status = source->next(frame)) == FrameStatus::kFrame; ++frames)
    if (frames % kApart == 0) checks.look_at(frame);
  std::vector<Finding> findings{check_images(*source)};
  if (status == FrameStatus::kError || frames == 0) return findings;
  for (Finding& finding : checks.findings()) findings.push_back(std::move(finding));
  return findings;
}

int examine(const DoctorArguments& arguments) {
  const Wanted wanted = wanted_of(arguments.source);
  std::vector<Finding> findings = check_machine(arguments.root);
  SystemV4l2Calls calls;
  for (const CameraOptions& camera : wanted.cameras) {
    for (Finding& finding : check_camera(calls, arguments.root, camera.path, camera.format))
      findings.push_back(std::move(finding));
  }
  for (Finding& finding : look_at_images(arguments)) findings.push_back(std::move(finding));
  const bool recording = !arguments.source.empty() && wanted.cameras.empty();
  if (!arguments.folder.empty())
    findings.push_back(check_disk(
        arguments.folder, recording ? recorded_bytes_per_second(arguments) : wanted.bytes_per_second));
  int exit_code = kOk;
  for (const Finding& finding : findings) {
    print(finding);
    if (finding.health == Health::kBad) exit_code = kFailedRun;
  }
  return exit_code;
}

}  // namespace

void add_doctor_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<DoctorArguments>();
  CLI::App* command = app.add_subcommand("doctor", "Say what on this machine will hurt real time");
  CLI::Option* source =
      command->add_option("SOURCE", arguments->source,
                          "Camera to run, e.g. v4l2:/dev/video0?size=640x480&fps=30, or a recording");
  command
      ->add_option("--calib", arguments->calibration,
                   "Calibration of a stereo camera: says whether it still holds")
      ->needs(source);
  command->add_option(
      "--record-to", arguments->folder,
      "Folder of recordings: measures how fast it can be written, and says what SOURCE needs (without "
      "one: a stereo camera of 640x480 at 30 fps)");
  command->add_option("--root", arguments->root, "Where proc and sys are (a tree to examine instead)")
      ->capture_default_str();
  command->callback([arguments, &exit_code] { exit_code = examine(*arguments); });
}

}  // namespace twofold
