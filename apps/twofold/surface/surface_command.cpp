// twofold surface: the depth of a recording, or of a finished run's keyframes, fused along known poses.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include <fmt/format.h>

#include "apps/twofold/commands.hpp"
#include "apps/twofold/output/output_folder.hpp"
#include "apps/twofold/run_output.hpp"
#include "apps/twofold/surface/depth_out_of_range.hpp"
#include "apps/twofold/surface/frame_colours.hpp"
#include "apps/twofold/surface/registered_cloud.hpp"
#include "apps/twofold/surface/surface_output.hpp"
#include "base/processor_time.hpp"
#include "imaging/row_offset.hpp"
#include "io/files/io_error.hpp"
#include "io/files/mesh_file.hpp"
#include "io/files/output_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/plots/plot.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/source_path.hpp"
#include "surface/meshing.hpp"
#include "surface/stereo/stereo_depth.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

struct SurfaceArguments {
  std::string input;
  std::string poses;
  std::string calibration;
  std::string out;
  MeshFiles files;
  std::string cloud;
  std::size_t every = 1;
  bool grey = false;
  SurfaceOptions options;
};

constexpr std::int64_t kSameTimeNs = 1'000'000;
constexpr std::int64_t kTruthGapNs = 50'000'000;  // that a camera's way between two true poses is guessed in

/// What a run was made of.
struct RunInput {
  std::string source;
  std::string calibration;  ///< file that the run was given; empty: none
  double row_offset = 0;    ///< of the right images, which the run took back [px]
  bool went_on = false;     ///< with a loaded map, in which it makes few keyframes of its own, or none
};

RunInput input_of_run(const fs::path& folder) {
  const fs::path file = folder / "summary.json";
  const auto summary = nlohmann::json::parse(std::ifstream(file), nullptr, false);
  if (!summary.is_object() || !summary.contains("source") || !summary["source"].is_string())
    throw IoError(file, "does not name the source of the run");
  if (summary.value("scale", "") == "arbitrary")
    throw IoError(file, "says that the scale is arbitrary (one camera): no depth fits its poses");
  RunInput input{summary["source"].get<std::string>(), {}};
  if (summary.contains("calibration_file") && summary["calibration_file"].is_string())
    input.calibration = summary["calibration_file"].get<std::string>();
  if (summary.contains("row_offset_px") && summary["row_offset_px"].is_number())
    input.row_offset = summary["row_offset_px"].get<double>();
  if (!(std::abs(input.row_offset) <= RowOffsetMeter::kMost))
    throw IoError(file, "row_offset_px is more than any run takes back");
  input.went_on = summary.value("loaded_map", nlohmann::json()).is_object();
  return input;
}

/// What to fuse, along which poses, and where to write.
struct SurfaceJob {
  std::unique_ptr<FrameSource> source;
  double row_offset = 0;  ///< RunInput::row_offset
  Trajectory poses;
  bool of_truth = false;  ///< poses are the recording's ground truth, of times of its own
  std::string poses_name;
  fs::path out;
};

/// Vertices are single-precision numbers: this far from the origin their steps are an eighth of a voxel.
void expect_within_reach(const SurfaceJob& job, double voxel) {
  const double farthest = voxel * (1 << 20);
  for (const TimedPose& pose : job.poses) {
    const double distance = pose.T_w_c.translation().norm();
    if (distance > farthest)
      throw IoError(job.poses_name, fmt::format("has a pose {:.0f} m from the origin; with voxels of {:g} m "
                                                "{:.0f} m is the most: shift the trajectory",
                                                distance, voxel, farthest));
  }
}

SurfaceJob surface_job(const SurfaceArguments& arguments) {
  SurfaceJob job;
  const bool is_run = fs::is_regular_file(fs::path(arguments.input) / "summary.json");
  const auto source_path = path_of_source(arguments.input);
  if (!is_run && source_path && !fs::exists(*source_path))
    throw IoError(*source_path, "no such file or folder");
  if (!is_run && arguments.poses.empty())
    throw IoError(arguments.input,
                  "is not the folder of a finished run: give --poses truth, or a trajectory");
  if (!is_run && arguments.out.empty()) throw IoError(arguments.input, "needs --out FOLDER for the surface");
  const RunInput input = is_run ? input_of_run(arguments.input) : RunInput{arguments.input, {}};
  SourceOptions options;
  for (const std::string& file : {input.calibration, arguments.calibration})
    if (!file.empty()) options.calibration = file;
  job.source = open_source(input.source, options);
  job.row_offset = input.row_offset;
  job.out = arguments.out.empty() ? arguments.input : arguments.out;
  if (arguments.poses == "truth") {
    job.poses = job.source->ground_truth();
    job.poses_name = "the ground truth";
    job.of_truth = true;
    if (job.poses.empty()) throw IoError(arguments.input, "has no ground truth");
  } else {
    const char* const own = input.went_on ? "trajectory.txt" : "keyframes.txt";
    const fs::path file =
        arguments.poses.empty() ? fs::path(arguments.input) / own : fs::path(arguments.poses);
    job.poses = read_trajectory(file);
    job.poses_name = file.string();
    if (job.poses.empty()) throw IoError(file, "holds no poses");
  }
  if (const std::string why = no_surface_reason(job.source->rig()); !why.empty())
    throw IoError(arguments.input, why);
  expect_within_reach(job, arguments.options.voxel);
  return job;
}

/// Of the nearest time, which is the frame's but for kSameTimeNs. Between two poses of a ground truth, which
/// was measured at times of its own: on the way from one to the other.
std::optional<SE3> pose_at(const SurfaceJob& job, std::int64_t t_ns) {
  const Trajectory& poses = job.poses;
  const auto after = std::lower_bound(poses.begin(), poses.end(), t_ns,
                                      [](const TimedPose& pose, std::int64_t t) { return pose.t_ns < t; });
  const TimedPose* later = after != poses.end() ? &*after : nullptr;
  const TimedPose* earlier = after != poses.begin() ? &*(after - 1) : nullptr;
  const bool earlier_is_nearer =
      later == nullptr || (earlier != nullptr && t_ns - earlier->t_ns < later->t_ns - t_ns);
  const TimedPose* nearest = earlier_is_nearer ? earlier : later;
  if (nearest != nullptr && std::abs(nearest->t_ns - t_ns) <= kSameTimeNs) return nearest->T_w_c;
  if (!job.of_truth || later == nullptr || earlier == nullptr || later->t_ns - earlier->t_ns > kTruthGapNs)
    return std::nullopt;
  const double share =
      static_cast<double>(t_ns - earlier->t_ns) / static_cast<double>(later->t_ns - earlier->t_ns);
  return earlier->T_w_c * SE3::exp(share * (earlier->T_w_c.inverse() * later->T_w_c).log());
}

class DepthFusion {
 public:
  DepthFusion(const SurfaceArguments& arguments, const SurfaceJob& job, const SurfaceOptions& options)
      : source_(*job.source),
        row_offset_(job.row_offset),
        volume_(options),
        grey_(arguments.grey),
        colours_(source_) {
    if (!arguments.cloud.empty()) cloud_.emplace(options.voxel);
  }

  void fuse(const Frame& frame, const SE3& T_w_c) {
    const Rig& rig = source_.rig();
    cv::Mat depth = frame.depth;
    if (rig.kind == SensorKind::kStereo)
      depth = stereo_depth(rig, frame.left, without_row_offset(frame.right, row_offset_), kNearestStereo);
    const cv::Mat colour = grey_ ? frame.left : colours_.left_image(frame);
    if (const std::string defect = depth_defect(rig, depth, colour); !defect.empty())
      throw IoError(fmt::format("frame {}", frame.index), defect);
    const std::int64_t begin_ns = thread_cpu_ns();
    const DepthView view = make_depth_view(rig, depth, colour);
    if (share_of_readings(view) == 0) {
      ++empty_;
      out_of_range_.look_at(rig, depth);
      return;
    }
    volume_.fuse(view, T_w_c.inverse());
    fusion_ns_ += thread_cpu_ns() - begin_ns;
    if (cloud_) cloud_->add(view, T_w_c);
    ++fused_;
  }

  /// If one was asked for.
  [[nodiscard]] const std::optional<RegisteredCloud>& cloud() const { return cloud_; }

  TriangleMesh finish(SurfaceFigures& figures) const {
    const std::int64_t begin_ns = thread_cpu_ns();
    TriangleMesh mesh = extract_mesh(volume_);
    figures.mesh_ms = static_cast<double>(thread_cpu_ns() - begin_ns) * 1e-6;
    describe_volume(volume_, figures);
    figures.fused = fused_;
    figures.fusion_ms = static_cast<double>(fusion_ns_) * 1e-6 / std::max(1, fused_);
    figures.memory_mb = static_cast<double>(volume_.bytes()) / (1 << 20);
    figures.triangles = mesh.triangles.size();
    figures.colour = grey_ ? "grey: as asked for (--grey)" : colours_.text();
    colours_.add_left_out(figures.left_out);
    if (empty_ > 0)
      figures.left_out.push_back(fmt::format("{} {}", empty_, out_of_range_.text(source_.rig())));
    return mesh;
  }

 private:
  const FrameSource& source_;
  const double row_offset_;
  SurfaceVolume volume_;
  std::optional<RegisteredCloud> cloud_;
  const bool grey_;
  FrameColours colours_;
  int fused_ = 0, empty_ = 0;
  DepthOutOfRange out_of_range_;
  std::int64_t fusion_ns_ = 0;
};

/// Most of a run's frames are no keyframes, and a recording's truth may have more poses than frames: what
/// one expects to find is said.
void say_without_partner(bool of_keyframes, std::size_t poses, std::size_t posed, std::size_t unposed,
                         SurfaceFigures& figures) {
  if (of_keyframes && posed < poses)
    figures.left_out.push_back(
        fmt::format("{} keyframes of whose time (to 1 ms) the source has no frame", poses - posed));
  if (!of_keyframes && unposed > 0)
    figures.left_out.push_back(fmt::format("{} frames of whose time (to 1 ms) there is no pose", unposed));
}

void run_surface(const SurfaceArguments& arguments) {
  SurfaceOptions options = arguments.options;
  if (const std::string reason = options.invalid_reason(); !reason.empty())
    throw IoError("twofold surface", reason);
  SurfaceJob job = surface_job(arguments);
  prepare_output_folder(job.out);
  expect_places_for(arguments.files);
  expect_place_for_file(arguments.cloud, "--cloud");
  if (options.depth_noise == 0) options.depth_noise = usual_depth_noise(job.source->rig());
  DepthFusion fusion(arguments, job, options);
  Frame frame;
  FrameStatus status;
  std::size_t posed = 0, unposed = 0;
  while ((status = job.source->next(frame)) == FrameStatus::kFrame) {
    const std::optional<SE3> T_w_c = pose_at(job, frame.t_ns);
    if (!T_w_c)
      ++unposed;
    else if (posed++ % arguments.every == 0)
      fusion.fuse(frame, *T_w_c);
  }
  if (status == FrameStatus::kError) throw IoError(job.source->error());
  if (posed == 0)
    throw IoError(job.poses_name, "no frame of the source was taken at the time of one of its poses");
  SurfaceFigures figures;
  const TriangleMesh mesh = fusion.finish(figures);
  say_without_partner(arguments.poses.empty(), job.poses.size(), posed, unposed, figures);
  print_surface(figures);
  print_source_report(job.source->report());
  if (mesh.triangles.empty())
    throw std::runtime_error(arguments.input + ": " + no_mesh_reason(figures, options.max_depth));
  const Vector3 up = up_axis_of(job.poses) == 2 ? Vector3::UnitZ() : Vector3(-Vector3::UnitY());
  write_surface(job.out, mesh, up, arguments.files);
  if (fusion.cloud()) write_ply_mesh(arguments.cloud, fusion.cloud()->points());
  fmt::print("written to  {}\n", job.out.string());
}

void add_fusion_options(CLI::App* command, const std::shared_ptr<SurfaceArguments>& arguments) {
  command->add_option("--voxel", arguments->options.voxel, "Distance of two samples of the surface [m]")
      ->capture_default_str();
  command->add_option("--every", arguments->every, "Fuse every so many-th frame that has a pose")
      ->check(above_zero())
      ->capture_default_str();
  command
      ->add_option("--max-depth", arguments->options.max_depth,
                   "Readings farther than this begin no surface [m]; 0: only those beyond the calibration's "
                   "depth: max (8 "
                   "m by default)")
      ->check(at_least_zero())
      ->capture_default_str();
  command
      ->add_option("--depth-noise", arguments->options.depth_noise,
                   "Standard deviation of a depth z over z^2 [1/m]; 0: the sensor's usual one")
      ->check(at_least_zero())
      ->capture_default_str();
}

}  // namespace

void add_surface_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<SurfaceArguments>();
  CLI::App* command =
      app.add_subcommand("surface",
                         "Fuse the depth of a run or a recording into a mesh; memory grows with "
                         "the surface, without a limit");
  command
      ->add_option("INPUT", arguments->input,
                   "Folder of a finished run, whose source is read again, or a source")
      ->required();
  command->add_option(
      "--poses", arguments->poses,
      "Trajectory to fuse along, or truth: the recording's own; a run's keyframes.txt otherwise, or its "
      "trajectory.txt if it went on with a loaded map, in which it makes few or none. A frame "
      "has a pose if their times differ by no more than 1 ms");
  command->add_option("--calib", arguments->calibration,
                      "Calibration file instead of the recording's own, or of that which the run was given");
  command->add_option("--out", arguments->out,
                      "Folder for surface.ply and surface.glb; the run's otherwise, whose own are replaced");
  add_fusion_options(command, arguments);
  command->add_flag("--grey", arguments->grey, "Brightness instead of the recording's colours");
  add_mesh_file_options(*command, arguments->files);
  command->add_option(
      "--cloud", arguments->cloud,
      "Write the depth images themselves to this PLY file, too, as points with colours, laid over "
      "each other along the poses; of the readings in a cube of a voxel their mean");
  command->callback([arguments, &exit_code] {
    run_surface(*arguments);
    exit_code = kOk;
  });
}

}  // namespace twofold
