// twofold object: the model of a thing on a turntable, or of one that a camera is carried around.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/twofold/commands.hpp"
#include "apps/twofold/interrupt.hpp"
#include "apps/twofold/map_parts.hpp"
#include "apps/twofold/output/output_folder.hpp"
#include "apps/twofold/run_output.hpp"
#include "apps/twofold/surface/object_model.hpp"
#include "apps/twofold/surface/object_source.hpp"
#include "base/angles.hpp"
#include "base/text_of_json.hpp"
#include "engine/engine.hpp"
#include "io/files/io_error.hpp"
#include "io/files/mesh_file.hpp"
#include "io/files/output_file.hpp"
#include "io/plots/plot.hpp"
#include "io/sources/open_source.hpp"
#include "loopclosure/default_vocabulary.hpp"

namespace twofold {
namespace {

struct ObjectArguments {
  std::string source;
  std::string calibration;
  std::string out = "out/object";
  std::string picture;
  bool deterministic = false;
  ObjectSourceOptions frames;
  SurfaceOptions surface;
};

constexpr double kTurntable = 0.01;  // [m] that the camera's way may deviate from turning about an axis

std::unique_ptr<ObjectSource> object_source(ObjectArguments& arguments) {
  SourceOptions options;
  options.stop = &interrupted();
  if (!arguments.calibration.empty()) options.calibration = arguments.calibration;
  std::unique_ptr<FrameSource> source = open_source(arguments.source, options);
  if (const std::string why = no_surface_reason(source->rig()); !why.empty())
    throw IoError(arguments.source, why);
  if (arguments.surface.depth_noise == 0) arguments.surface.depth_noise = usual_depth_noise(source->rig());
  arguments.frames.mask.depth_noise = arguments.surface.depth_noise;
  for (const std::string& reason : {arguments.frames.invalid_reason(), arguments.surface.invalid_reason()})
    if (!reason.empty()) throw IoError("twofold object", reason);
  return std::make_unique<ObjectSource>(std::move(source), arguments.frames);
}

/// Tracking and mapping are laid out for scenes that fill the image. An object has a small part of it; the
/// rest was filled in (fill_outside), and says nothing.
EngineOptions options_for_object(const Rig& rig) {
  constexpr double kShare = 0.1;  // of the image, that an object is thought to have
  constexpr int kCellUnit = 4;    // [px] cells are multiples of it
  EngineOptions options;
  NewPointOptions& points = options.tracker.new_points;
  // Patches of coarser levels reach around what is round or narrow and beyond its outline, which keeps its
  // place when the object turns.
  points.corner_levels = 1;
  // So small that the object's part has a cell for each point.
  const double area = kShare * rig.camera.width * rig.camera.height;
  const auto units = std::lround(std::sqrt(area / points.max_points) / kCellUnit);
  points.cell_px = std::clamp(kCellUnit * static_cast<int>(units), 2 * kCellUnit, points.cell_px);
  // They are spread over the whole image: so many that the object's share of them is as large as usual.
  MetricLoopOptions& loop = options.mapper.loop;
  loop.max_searches = static_cast<int>(std::lround(loop.max_searches / kShare));
  return options;
}

bool is_turntable(const ObjectModel& model) {
  return model.axis && model.axis->deviation < kTurntable;
}

/// What is missing when nothing turned: then what was fused is what stood in front, on whatever plane there
/// was. Empty when the camera saw the object from sides enough, or there is none.
std::string no_object_reason(const ObjectModel& model, const Trajectory& poses) {
  constexpr double kFewSides = 30 * kDegree;
  if (model.mesh.triangles.empty()) return {};
  const double angle = widest_view_angle(model.box.centre, poses);
  if (angle >= kFewSides) return {};
  return fmt::format(
      "what is nearer than --depth-cut was seen from one side only, from directions that differ by {:.0f} "
      "degrees: the object must turn, or the camera be carried around it, by {:.0f} at least; a surface of "
      "what is in view is made by twofold surface, and by twofold run --surface",
      angle / kDegree, kFewSides / kDegree);
}

/// An object stands in the middle of the images; a table or a room goes on beyond them.
void note_if_cut_off(const ObjectArguments& arguments, const ObjectSource& source) {
  constexpr double kMany = 0.2;
  const double share = source.share_cut_off();
  if (share <= kMany) return;
  fmt::print(
      stderr,
      "twofold: {}: in {:.0f} % of the frames what is taken for the object reaches the image's border: "
      "it is more than one thing, the table or the room, or the camera was too near; --depth-cut says "
      "how far away it may be, --held that it stands on nothing\n",
      arguments.source, 100 * share);
}

nlohmann::ordered_json vector_json(const Vector3& x) {
  return {x.x(), x.y(), x.z()};
}

nlohmann::ordered_json object_json(const ObjectModel& model, const RunResult& result, double cut_off) {
  nlohmann::ordered_json json;
  json["box"] = {{"centre", vector_json(model.box.centre)}, {"size_m", vector_json(model.box.size)}};
  for (const Vector3& axis : model.box.axes) json["box"]["axes"].push_back(vector_json(axis));
  json["up"] = vector_json(model.up);
  json["axis"] = nullptr;
  if (is_turntable(model)) {
    json["axis"] = {{"direction", vector_json(model.axis->direction)},
                    {"point", vector_json(model.axis->point)},
                    {"rate_deg_s", model.axis->rate / kDegree},
                    {"turned_deg", model.axis->turned / kDegree},
                    {"deviation_m", model.axis->deviation}};
  }
  json["share_cut_off"] = cut_off;
  json["metric_loops"] = result.mapping.metric_loops;
  json["loops"] = result.loops.size();
  json["surface"] = surface_json(model.figures);
  return json;
}

void print_object(const ObjectModel& model, const RunResult& result) {
  const Vector3 mm = 1000 * model.box.size;
  fmt::print("object      box {:.1f} x {:.1f} x {:.1f} mm (the last upright)\n", mm.x(), mm.y(), mm.z());
  if (is_turntable(model)) {
    const TurntableAxis& axis = *model.axis;
    fmt::print(
        "turntable   {:.2f} degrees a second, {:.1f} degrees in all, the way deviates by {:.2f} mm from it\n",
        axis.rate / kDegree, axis.turned / kDegree, 1000 * axis.deviation);
    fmt::print("            axis ({:.4f} {:.4f} {:.4f}) through ({:.4f} {:.4f} {:.4f}) m of the map\n",
               axis.direction.x(), axis.direction.y(), axis.direction.z(), axis.point.x(), axis.point.y(),
               axis.point.z());
  } else {
    fmt::print("turntable   none: the camera did not turn about one axis\n");
  }
  fmt::print("closed by   {} edges of metric loops, {} loops by appearance\n", result.mapping.metric_loops,
             result.loops.size());
}

void write_object(const ObjectArguments& arguments, const ObjectModel& model, const RunResult& result,
                  double cut_off) {
  const std::filesystem::path out = arguments.out;
  write_surface(out, model.mesh, model.up);
  TriangleMesh cloud = model.mesh;
  cloud.triangles.clear();
  write_ply_mesh(out / "cloud.ply", cloud);
  write_file(out / "object.json", text_of_json(object_json(model, result, cut_off), 2) + "\n");
  if (!arguments.picture.empty()) write_png(arguments.picture, draw_object(model));
}

void run_object(ObjectArguments& arguments) {
  expect_output_folder(arguments.out, arguments.source);
  prepare_output_folder(arguments.out);
  expect_place_for_file(arguments.picture, "--picture");
  const std::unique_ptr<ObjectSource> source = object_source(arguments);
  remove_earlier_run(arguments.out, arguments.calibration);
  EngineOptions options = options_for_object(source->rig());
  options.deterministic = arguments.deterministic;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  options.logs.folder = arguments.out;
  options.pacing.live = source->is_live();
  catch_interrupts();
  Engine engine(source->rig(), options);
  const FrameFeed feed = [&](Frame& frame) { return source->next(frame); };
  RunResult result = engine.run(feed, interrupted(), [](const Progress&) {});
  if (!source->error().empty()) throw IoError(arguments.source, source->error());
  if (!result.error.empty()) throw std::runtime_error(result.error);
  if (const std::string reason = source->nothing_shown(); !reason.empty())
    throw IoError(arguments.source, reason);
  if (result.counts.tracked == 0)
    throw std::runtime_error(
        arguments.source +
        ": the object could not be tracked: it is too small in the images, or without texture");
  const std::vector<MapPart> parts = map_parts(result, options);
  const ObjectModel model = build_object(*source, parts.front().trajectory, arguments.surface);
  if (const std::string reason = no_object_reason(model, parts.front().trajectory); !reason.empty())
    throw std::runtime_error(arguments.source + ": " + reason);
  update_peak_memory(result);
  write_run_output(arguments.out, {arguments.source, "", arguments.calibration, nullptr, result.losses},
                   *source, options, result, parts, surface_json(model.figures));
  print_summary(arguments.out, source->rig(), options, result, parts);
  print_surface(model.figures);
  print_source_report(source->report());
  if (model.mesh.triangles.empty())
    throw std::runtime_error(arguments.source + ": " +
                             no_mesh_reason(model.figures, arguments.surface.max_depth));
  write_object(arguments, model, result, source->share_cut_off());
  print_object(model, result);
  note_if_cut_off(arguments, *source);
  if (!result.losses.empty()) throw std::runtime_error(fmt::format("{}", fmt::join(result.losses, "; ")));
}

void add_mask_options(CLI::App& command, ObjectArguments& arguments) {
  ObjectMaskOptions& mask = arguments.frames.mask;
  command.add_option("--depth-cut", mask.farthest, "Nothing farther than this belongs to the object [m]")
      ->check(above_zero())
      ->capture_default_str();
  command
      .add_option("--above", mask.above,
                  "The object begins this far above the plane that it stands on, or four standard deviations "
                  "of the depth [m]")
      ->check(at_least_zero())
      ->capture_default_str();
  command.add_flag("--held", mask.held,
                   "The object is held by hand: no plane that it stands on is looked for, and what is nearer "
                   "than --depth-cut is the object, the hand with it");
  command.add_option("--erode", mask.erode, "Pixels taken away from the rim of what is left")
      ->check(CLI::Range(0, 20))
      ->capture_default_str();
  command
      .add_option("--depth-noise", arguments.surface.depth_noise,
                  "Standard deviation of a depth z over z^2 [1/m]; 0: the sensor's usual one")
      ->check(at_least_zero())
      ->capture_default_str();
}

}  // namespace

void add_object_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<ObjectArguments>();
  arguments->surface.voxel = 0.002;
  CLI::App* command =
      app.add_subcommand("object", "Model a thing on a turntable, or one that a camera is carried around");
  command->add_option("SOURCE", arguments->source, "RGB-D or stereo, as for run")->required();
  command->add_option("--calib", arguments->calibration, "Calibration file instead of the recording's own");
  command
      ->add_option("--out", arguments->out,
                   "Folder for surface.ply, surface.glb, cloud.ply, object.json and the run's files")
      ->capture_default_str();
  command->add_option("--voxel", arguments->surface.voxel, "Distance of two samples of the surface [m]")
      ->capture_default_str();
  command->add_option("--every", arguments->frames.keep_every, "Fuse every so many-th frame")
      ->check(above_zero())
      ->capture_default_str();
  add_mask_options(*command, *arguments);
  command->add_flag("--deterministic", arguments->deterministic, "One thread: equal input, equal bytes");
  command->add_option("--picture", arguments->picture, "Draw the object from four sides to this PNG file");
  command->callback([arguments, &exit_code] {
    run_object(*arguments);
    exit_code = kOk;
  });
}

}  // namespace twofold
