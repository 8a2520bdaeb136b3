#include "apps/twofold/calibration/auto_calibration.hpp"

#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/calibrated_source.hpp"
#include "selfcalibration/clip_collector.hpp"

namespace twofold {
namespace {

constexpr double kAttemptEvery = 5;   // [s] of video
constexpr double kLongest = 30;       // [s] of video
constexpr double kGoodEnough = 0.01;  // share of the focal length: no more of the video is needed

using Found = tl::expected<SelfCalibration, std::string>;

/// Reads on for `seconds` from the first frame; false when the source ends before.
bool collect(FrameSource& source, double seconds, std::optional<std::int64_t>& first_ns,
             std::int64_t& last_ns, ClipCollector& collector) {
  Frame frame;
  for (;;) {
    const FrameStatus status = source.next(frame);
    if (status == FrameStatus::kError) throw IoError(source.error());
    if (status == FrameStatus::kEnd) return false;
    if (!first_ns) first_ns = frame.t_ns;
    last_ns = frame.t_ns;
    collector.add_frame(frame.left, frame.t_ns);
    if (static_cast<double>(frame.t_ns - *first_ns) * 1e-9 >= seconds) return true;
  }
}

Found calibrate(FrameSource& source, double& seconds) {
  const PinholeCamera& camera = source.rig().camera;
  ClipCollector collector(camera.width, camera.height);
  std::optional<std::int64_t> first_ns;
  std::int64_t last_ns = 0;
  for (double until = kAttemptEvery;; until += kAttemptEvery) {
    const bool goes_on = collect(source, until, first_ns, last_ns, collector) && until < kLongest;
    collector.finish();
    Found found = self_calibrate(collector.clips(), camera.width, camera.height);
    seconds = first_ns ? static_cast<double>(last_ns - *first_ns) * 1e-9 : 0;
    if (!goes_on || (found && found->sigma[0] <= kGoodEnough)) return found;
    if (source.is_live())
      fmt::print(stderr, "calibrating: {}\n",
                 found ? fmt::format("{:.0f} px +- {:.0f}, going on", found->lens.f(), found->f_sigma)
                       : found.error());
  }
}

}  // namespace

std::unique_ptr<FrameSource> open_with_auto_calibration(const std::string& text, SourceOptions options,
                                                        const std::filesystem::path& folder,
                                                        AutoCalibration& result) {
  options.calibration.reset();
  options.suppose_camera = true;
  const bool preload = std::exchange(options.preload, false);
  auto source = open_source(text, options);
  if (source->rig().kind != SensorKind::kMono)
    throw IoError("--calib auto", "is for one camera: add --camera mono");
  if (source->is_live())
    fmt::print(stderr,
               "calibrating: turn the camera slowly to the sides, up and down, and about its optical axis\n");
  const Found found = calibrate(*source, result.seconds);
  if (!found) throw IoError(text, found.error());
  const PinholeCamera& camera = source->rig().camera;
  result.found = *found;
  result.calibration = to_calibration(*found, camera.width, camera.height);
  result.file = folder / kCalibrationName;
  if (!source->is_live()) {
    options.preload = preload;
    source = open_source(text, options);
  }
  try {
    source = std::make_unique<CalibratedSource>(std::move(source), result.calibration);
  } catch (const std::runtime_error& e) {
    throw IoError(text, std::string("the calibration found from the video cannot be used: ") + e.what());
  }
  write_calibration(
      result.file, result.calibration,
      {kCalibratedByVideo, static_cast<int>(found->clips), found->corner_sigma_px, found->f_sigma, {}});
  return source;
}

nlohmann::ordered_json auto_calibration_json(const AutoCalibration& result) {
  const SharedLens& lens = result.found.lens;
  return {{"focal_px", lens.f()},
          {"focal_sigma_px", result.found.f_sigma},
          {"centre_px", {lens.centre.x(), lens.centre.y()}},
          {"radial", {lens.k1, lens.k2}},
          {"readout_ms", 1e3 * lens.readout},
          {"readout_sigma_ms", 1e3 * result.found.readout_sigma},
          {"clips", result.found.clips},
          {"seconds", result.seconds},
          {"file", result.file.string()}};
}

void print_auto_calibration(const AutoCalibration& result) {
  fmt::print("calibration f {:.1f} +- {:.1f} px, from {:.0f} s of the video itself; in {}\n",
             result.found.lens.f(), result.found.f_sigma, result.seconds, result.file.string());
  if (result.calibration.readout)
    fmt::print("            a rolling shutter, readout {:.1f} +- {:.1f} ms\n",
               1e3 * *result.calibration.readout, 1e3 * result.found.readout_sigma);
}

}  // namespace twofold
