#include <unistd.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "apps/twofold/commands.hpp"
#include "apps/twofold/surface/true_surface.hpp"
#include "base/counted.hpp"
#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/open_source.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

struct RenderArguments {
  std::string source;
  std::string out;
  std::string surface;
  std::string seen;
  int seen_every = 5;
};

constexpr double kNsPerSecond = 1e9;

/// One sensor's folder in the EuRoC layout: data/TIME.png, data.csv, sensor.yaml.
class SensorFolder {
 public:
  explicit SensorFolder(fs::path folder) : folder_(std::move(folder)) {
    prepare_output_folder(folder_ / "data");
    list_ = "#timestamp [ns],filename\n";
  }

  void add(std::int64_t t_ns, const cv::Mat& image) {
    const std::string name = fmt::format("{}.png", t_ns);
    const fs::path file = folder_ / "data" / name;
    // Lowest compression: the noise in the images cannot be compressed, and this is five times as fast.
    std::vector<unsigned char> bytes;
    if (!cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1}))
      throw IoError(file, "cannot be encoded");
    write_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    list_ += fmt::format("{},{}\n", t_ns, name);
  }

  void finish(const std::string& sensor_yaml) const {
    write_file(folder_ / "data.csv", list_);
    write_file(folder_ / "sensor.yaml", sensor_yaml);
  }

 private:
  fs::path folder_;
  std::string list_;
};

std::string pose_yaml(const SE3& T_b_s) {
  const Matrix4 T = T_b_s.matrix();
  std::string data;
  for (int i = 0; i < 16; ++i) data += fmt::format("{}{}", i == 0 ? "" : ", ", T(i / 4, i % 4));
  return fmt::format("T_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n", data);
}

std::string camera_yaml(const Rig& rig, const std::string& what, double shift_right, double rate_hz) {
  const PinholeCamera& c = rig.camera;
  std::string yaml = fmt::format("sensor_type: camera\ncomment: {}\n", what) +
                     pose_yaml(SE3(SO3(), Vector3(shift_right, 0, 0))) +
                     fmt::format(
                         "rate_hz: {}\nresolution: [{}, {}]\ncamera_model: pinhole\n"
                         "intrinsics: [{}, {}, {}, {}]\n",
                         rate_hz, c.width, c.height, c.fx, c.fy, c.cx, c.cy);
  return yaml + "distortion_model: radial-tangential\ndistortion_coefficients: [0.0, 0.0, 0.0, 0.0]\n";
}

/// docs/calibration.md form: what a reader of other layouts (or --calib) needs.
std::string calibration_yaml(const Rig& rig, double rate_hz) {
  const PinholeCamera& c = rig.camera;
  const char* sensor = rig.kind == SensorKind::kStereo ? "stereo"
                       : rig.kind == SensorKind::kRgbd ? "rgbd"
                                                       : "mono";
  std::string yaml =
      fmt::format("sensor: {}\nfps: {}\ncameras:\n  - size: [{}, {}]\n    intrinsics: [{}, {}, {}, {}]\n",
                  sensor, rate_hz, c.width, c.height, c.fx, c.fy, c.cx, c.cy);
  if (rig.kind == SensorKind::kStereo) yaml += fmt::format("baseline: {}\n", rig.baseline);
  if (rig.kind == SensorKind::kRgbd)
    yaml += fmt::format("depth:\n  unit: {}\n  min: {}\n  max: {}\n  virtual_baseline: {}\n", rig.depth_unit,
                        rig.depth_min, rig.depth_max, rig.baseline);
  return yaml;
}

void write_truth(const fs::path& folder, const Trajectory& truth) {
  std::string text =
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n";
  for (const TimedPose& pose : truth) {
    const Eigen::Quaterniond& q = pose.T_w_c.so3().quaternion();
    const Vector3& p = pose.T_w_c.translation();
    text +=
        fmt::format("{},{},{},{},{},{},{},{}\n", pose.t_ns, p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z());
  }
  prepare_output_folder(folder);
  write_file(folder / "data.csv", text);
  // The truth is that of cam0, which is the body.
  write_file(folder / "sensor.yaml", "sensor_type: pose\n" + pose_yaml(SE3()));
}

double rate_of(const Trajectory& truth) {
  std::int64_t shortest = 0;
  for (std::size_t i = 1; i < truth.size(); ++i) {
    const std::int64_t step = truth[i].t_ns - truth[i - 1].t_ns;
    if (shortest == 0 || step < shortest) shortest = step;
  }
  return shortest > 0 ? kNsPerSecond / static_cast<double>(shortest) : 1.0;
}

class RenderProgress {
 public:
  explicit RenderProgress(std::int64_t total) : total_(total), shown_(isatty(STDERR_FILENO) != 0) {}
  void step() {
    if (++done_; shown_ && done_ % 10 == 0) fmt::print(stderr, "\rrendered {} of {} frames", done_, total_);
  }
  ~RenderProgress() {
    if (shown_) fmt::print(stderr, "\r\033[K");
  }
  [[nodiscard]] std::int64_t done() const { return done_; }

 private:
  std::int64_t total_;
  std::int64_t done_ = 0;
  bool shown_;
};

/// Beside mav0, what the TUM layout asks for: nothing in EuRoC's reads depth.
std::string association_line(std::int64_t t_ns) {
  const std::string seconds = fmt::format("{}.{:09}", t_ns / 1'000'000'000, t_ns % 1'000'000'000);
  return fmt::format("{0} mav0/cam0/data/{1}.png {0} mav0/depth0/data/{1}.png\n", seconds, t_ns);
}

/// What is rendered, in EuRoC's layout; with depth, in TUM's as well.
class RenderedRecording {
 public:
  /// Throws IoError when the folder has one already.
  RenderedRecording(const fs::path& folder, const Rig& rig, double rate_hz)
      : folder_(folder), rig_(rig), rate_hz_(rate_hz) {
    std::error_code ignored;
    if (fs::exists(mav(), ignored)) throw IoError(mav(), "is there already; give another folder");
    left_.emplace(mav() / "cam0");
    if (rig.kind == SensorKind::kStereo) right_.emplace(mav() / "cam1");
    if (rig.kind == SensorKind::kRgbd) depth_.emplace(mav() / "depth0");
  }

  void add(const Frame& frame) {
    left_->add(frame.t_ns, frame.left);
    if (right_) right_->add(frame.t_ns, frame.right);
    if (!depth_) return;
    depth_->add(frame.t_ns, frame.depth);
    associations_ += association_line(frame.t_ns);
  }

  void finish(const Trajectory& truth) const {
    left_->finish(camera_yaml(rig_, "rendered, left", 0, rate_hz_));
    if (right_) right_->finish(camera_yaml(rig_, "rendered, right", rig_.baseline, rate_hz_));
    if (depth_) {
      depth_->finish(camera_yaml(rig_, "rendered, depth", 0, rate_hz_) +
                     fmt::format("depth_unit: {}\n", rig_.depth_unit));
      write_file(folder_ / "associations.txt", associations_);
      write_tum_trajectory(folder_ / "groundtruth.txt", truth);
    }
    write_truth(mav() / "state_groundtruth_estimate0", truth);
    write_file(folder_ / "calibration.yaml", calibration_yaml(rig_, rate_hz_));
  }

 private:
  [[nodiscard]] fs::path mav() const { return folder_ / "mav0"; }

  const fs::path folder_;
  const Rig rig_;
  const double rate_hz_;
  std::optional<SensorFolder> left_, right_, depth_;
  std::string associations_;
};

void run_render(const RenderArguments& arguments) {
  if (arguments.source.rfind("synthetic:", 0) != 0)
    throw IoError(arguments.source, "is not a rendered source (synthetic:SCENE?...)");
  const auto source = open_source(arguments.source);
  if (!arguments.surface.empty()) write_true_surface(arguments.surface, *source);
  if (!arguments.seen.empty())
    write_seen_surface(arguments.seen, *open_source(arguments.source), arguments.seen_every);
  if (arguments.out.empty()) return;

  RenderedRecording recording(arguments.out, source->rig(), rate_of(source->ground_truth()));
  RenderProgress progress(source->frame_count().value_or(0));
  Frame frame;
  FrameStatus status;
  while ((status = source->next(frame)) == FrameStatus::kFrame) {
    recording.add(frame);
    progress.step();
  }
  if (status == FrameStatus::kError) throw IoError(source->error());
  recording.finish(source->ground_truth());
  fmt::print("{} written to {} (read with {}:{})\n", counted(progress.done(), "frame"), arguments.out,
             source->rig().kind == SensorKind::kRgbd ? "tum" : "euroc", arguments.out);
}

}  // namespace

void add_render_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<RenderArguments>();
  CLI::App* command = app.add_subcommand("render", "Write a rendered scene as a recording in EuRoC's layout");
  command->add_option("SOURCE", arguments->source, "synthetic:SCENE?key=value&...")->required();
  auto* out = command->add_option(
      "--out", arguments->out,
      "folder to write mav0 into (EuRoC's layout; RGB-D: TUM's, as associations.txt says)");
  auto* surface = command->add_option("--surface", arguments->surface,
                                      "write the scene's true surfaces to this mesh (PLY)");
  auto* seen =
      command->add_option("--seen", arguments->seen,
                          "the same, as far as depth images show them (sensor=rgbd) or both cameras do "
                          "(sensor=stereo); with --out or --surface or alone");
  command
      ->add_option("--seen-every", arguments->seen_every,
                   "for --seen, every so many-th frame is asked: as many as surface --every fuses")
      ->check(above_zero())
      ->capture_default_str()
      ->needs(seen);
  command->callback([arguments, out, surface, seen, &exit_code] {
    if (out->count() + surface->count() + seen->count() == 0)
      throw IoError("--out", "is required, or --surface or --seen");
    run_render(*arguments);
    exit_code = kOk;
  });
}

}  // namespace twofold
