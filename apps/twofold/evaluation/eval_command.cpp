#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include "apps/twofold/commands.hpp"
#include "apps/twofold/evaluation/pose_pairing.hpp"
#include "apps/twofold/output/output_folder.hpp"
#include "apps/twofold/surface/eval_surface.hpp"
#include "base/text_of_json.hpp"
#include "evaluation/evaluation.hpp"
#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"
#include "io/plots/plot.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

struct EvalArguments {
  std::string estimate, truth;
  Alignment alignment = Alignment::kSe3;
  double max_difference_s = 0.01;
  std::string json, plot;
  bool surface = false;
  bool fit = false;
  std::string seen;
  double threshold = 0.01;
};

const std::map<std::string, Alignment> kAlignments{
    {"none", Alignment::kNone}, {"se3", Alignment::kSe3}, {"sim3", Alignment::kSim3}};

std::string name_of(Alignment alignment) {
  for (const auto& [name, value] : kAlignments) {
    if (value == alignment) return name;
  }
  return "";
}

void print_row(const char* name, const char* unit, const ErrorStatistics& s) {
  fmt::print("{:<22} {:>4} {:>6} {:>11.6f} {:>11.6f} {:>11.6f} {:>11.6f} {:>11.6f}\n", name, unit, s.count,
             s.rmse, s.mean, s.median, s.stddev, s.max);
}

/// "100 m", "100 and 200 m", "100, 200, .. 800 m".
std::string lengths_text(const std::vector<SegmentErrors>& by_length) {
  switch (by_length.size()) {
    case 1:
      return fmt::format("{:g} m", by_length[0].length);
    case 2:
      return fmt::format("{:g} and {:g} m", by_length[0].length, by_length[1].length);
    default:
      return fmt::format("{:g}, {:g}, .. {:g} m", by_length[0].length, by_length[1].length,
                         by_length.back().length);
  }
}

void print_table(const EvalArguments& arguments, const Evaluation& e, std::size_t of, bool has_times) {
  fmt::print(
      "{} against {}\n{} poses of {} have a partner, path {:.3f} m, align {}, scale {:.6f}, ATE {:.4f} % of "
      "the path\n",
      arguments.estimate, arguments.truth, e.pairs.size(), of, e.path_length, name_of(arguments.alignment),
      e.S_w_e.scale(), e.path_length > 0 ? 100 * e.absolute.rmse / e.path_length : 0.0);
  if (e.half_scales) {
    const auto& [first, second] = *e.half_scales;
    fmt::print("scale of the halves {:.6f} and {:.6f}, {:.3f} % apart\n", first, second,
               100 * std::abs(std::log(second / first)));
  }
  fmt::print("\n{:<22} {:>4} {:>6} {:>11} {:>11} {:>11} {:>11} {:>11}\n", "", "unit", "count", "rmse", "mean",
             "median", "std", "max");
  print_row("ATE", "m", e.absolute);
  print_row("ATE rotation", "deg", e.absolute_rotation_deg);
  if (has_times) {
    print_row("RPE over 1 s", "m", e.per_second.translation);
    print_row("RPE over 1 s", "deg", e.per_second.rotation_deg);
    print_row("RPE over 1 s / path", "%", e.per_second.translation_percent);
  }
  print_row("RPE over 1 m", "m", e.per_metre.translation);
  print_row("RPE over 1 m", "deg", e.per_metre.rotation_deg);
  print_row("RPE over 1 m / path", "%", e.per_metre.translation_percent);
  if (const SegmentErrors& mean = e.kitti.mean; mean.count > 0) {
    fmt::print("\nKITTI's t_rel {:.4f} %, r_rel {:.4f} deg/100 m: means over {} segments of {}\n",
               mean.translation_percent, mean.rotation_deg_per_100_m, mean.count,
               lengths_text(e.kitti.by_length));
  }
}

nlohmann::ordered_json to_json(const ErrorStatistics& s) {
  return {{"count", s.count}, {"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median},
          {"std", s.stddev},  {"min", s.min},   {"max", s.max}};
}

nlohmann::ordered_json to_json(const RelativeError& e) {
  return {{"translation_m", to_json(e.translation)},
          {"rotation_deg", to_json(e.rotation_deg)},
          {"translation_percent", to_json(e.translation_percent)}};
}

nlohmann::ordered_json to_json(const SegmentErrors& e) {
  nlohmann::ordered_json json;
  if (e.length > 0) json["length_m"] = e.length;
  json["count"] = e.count;
  json["t_rel_percent"] = e.translation_percent;
  json["r_rel_deg_per_100_m"] = e.rotation_deg_per_100_m;
  return json;
}

nlohmann::ordered_json to_json(const KittiErrors& e) {
  nlohmann::ordered_json json = to_json(e.mean);
  for (const SegmentErrors& one : e.by_length) json["by_length"].push_back(to_json(one));
  return json;
}

std::string json_text(const EvalArguments& arguments, const Evaluation& e, std::size_t of, bool has_times) {
  const Eigen::Quaterniond& q = e.S_w_e.so3().quaternion();
  const Vector3& t = e.S_w_e.translation();
  nlohmann::ordered_json json{{"estimate", arguments.estimate},
                              {"ground_truth", arguments.truth},
                              {"align", name_of(arguments.alignment)},
                              {"poses", e.pairs.size()},
                              {"poses_of_estimate", of},
                              {"path_length_m", e.path_length},
                              {"alignment",
                               {{"scale", e.S_w_e.scale()},
                                {"rotation_xyzw", {q.x(), q.y(), q.z(), q.w()}},
                                {"translation_m", {t.x(), t.y(), t.z()}}}},
                              {"ate_m", to_json(e.absolute)},
                              {"ate_rotation_deg", to_json(e.absolute_rotation_deg)}};
  if (e.half_scales) json["half_scales"] = *e.half_scales;
  if (has_times) json["rpe_1s"] = to_json(e.per_second);
  json["rpe_1m"] = to_json(e.per_metre);
  if (e.kitti.mean.count > 0) json["kitti"] = to_json(e.kitti);
  return text_of_json(json, 2) + "\n";
}

cv::Mat draw(const EvalArguments& arguments, const Evaluation& e) {
  Trajectory truth, estimate;
  for (const PosePair& pair : e.pairs) {
    truth.push_back({pair.t_ns, pair.T_w_c});
    estimate.push_back({pair.t_ns, pair.T_e_c});
  }
  PlotOptions options;
  options.title = fs::path(arguments.estimate).filename().string();
  options.subtitle =
      fmt::format("{} poses, {:.1f} m, ATE {:.4f} m rmse, {:.4f} m max, align {}", e.pairs.size(),
                  e.path_length, e.absolute.rmse, e.absolute.max, name_of(arguments.alignment));
  options.up_axis = up_axis_of(truth);
  return draw_top_down(
      {{"ground truth", positions(truth), plot_colours::kTruth, 4, {}},
       {"estimate, coloured by error", positions(estimate), plot_colours::kFinal, 2, e.position_errors}},
      options);
}

/// A run leaves its summary beside its trajectories.
void warn_of_arbitrary_scale(const fs::path& estimate) {
  std::ifstream file(estimate.parent_path() / "summary.json");
  const nlohmann::json summary = nlohmann::json::parse(file, nullptr, false);
  if (!summary.is_object() || !summary.contains("scale") || summary["scale"] != "arbitrary") return;
  fmt::print(stderr,
             "twofold: {}: of one camera, whose scale is arbitrary: --align sim3 leaves it out of account\n",
             estimate.string());
}

void warn_of_constant_turn(const Evaluation& evaluation) {
  const auto turn = constant_turn_deg(evaluation.pairs);
  if (!turn) return;
  const char* why = is_straight(evaluation.pairs, evaluation.absolute.rmse)
                        ? "the path is so straight that aligned positions leave the turn about it open"
                        : "is one of them the body's, the other the camera's?";
  fmt::print(stderr, "twofold: the orientations differ by a constant turn of {:.0f} deg: {}\n", *turn, why);
}

void run_eval(const EvalArguments& arguments) {
  expect_place_for_file(arguments.json, "--json");
  expect_place_for_file(arguments.plot, "--plot");
  if (arguments.surface) {
    if (arguments.alignment == Alignment::kSim3)
      throw IoError("--align", "sim3 is for trajectories: a surface is moved rigidly (se3) or not (none)");
    eval_surface({arguments.estimate, arguments.truth, arguments.seen,
                  arguments.alignment != Alignment::kNone, arguments.fit, arguments.threshold, arguments.json,
                  arguments.plot});
    return;
  }
  EvaluationOptions options;
  options.alignment = arguments.alignment;
  const PosePairing pairing =
      pair_poses(arguments.estimate, arguments.truth, std::llround(arguments.max_difference_s * 1e9));
  const auto evaluation = evaluate(pairing.pairs, options);
  if (!evaluation) throw IoError(arguments.estimate, evaluation.error());
  const bool has_times = pairing.has_times;
  print_table(arguments, *evaluation, pairing.of, has_times);
  if (arguments.alignment != Alignment::kSim3) warn_of_arbitrary_scale(arguments.estimate);
  if (arguments.alignment != Alignment::kNone) warn_of_constant_turn(*evaluation);
  if (!arguments.json.empty())
    write_file(arguments.json, json_text(arguments, *evaluation, pairing.of, has_times));
  if (!arguments.plot.empty()) write_png(arguments.plot, draw(arguments, *evaluation));
}

void add_surface_options(CLI::App* command, CLI::Option* max_difference,
                         const std::shared_ptr<EvalArguments>& arguments) {
  CLI::Option* surface =
      command
          ->add_flag("--surface", arguments->surface,
                     "compare meshes; moved as the estimate's trajectory.txt onto groundtruth.txt beside it, "
                     "if they are there, unless --align none")
          ->excludes(max_difference);
  command
      ->add_flag("--fit", arguments->fit,
                 "--surface: then moves the estimate so that the surfaces fit best (iterated closest "
                 "points); they must "
                 "lie within 25 cm before")
      ->needs(surface);
  command
      ->add_option("--seen", arguments->seen,
                   "--surface: mesh of what a camera saw (render --seen): completeness is asked of it")
      ->needs(surface);
  command
      ->add_option("--threshold", arguments->threshold,
                   "--surface: distance of surfaces that counts as near [m]; distances are cut at ten times "
                   "it, points are half of it apart")
      ->check(CLI::Range(1e-4, 10.0))
      ->capture_default_str()
      ->needs(surface);
}

}  // namespace

void add_eval_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<EvalArguments>();
  CLI::App* command = app.add_subcommand("eval", "Compare a trajectory, or a surface, with the ground truth");
  command->add_option("ESTIMATE", arguments->estimate, "trajectory, TUM or KITTI form; --surface: mesh (PLY)")
      ->required();
  command
      ->add_option("GROUNDTRUTH", arguments->truth,
                   "trajectory, TUM, KITTI or EuRoC form, or a recording; --surface: mesh (PLY)")
      ->required();
  command
      ->add_option_function<std::string>(
          "--align", [arguments](const std::string& name) { arguments->alignment = kAlignments.at(name); },
          "what the estimate may be moved by: nothing, a rigid motion, or with scale")
      ->check(CLI::IsMember({"none", "se3", "sim3"}))
      ->default_str("se3");
  CLI::Option* difference =
      command
          ->add_option("--max-difference", arguments->max_difference_s,
                       "largest difference of time stamps [s]: each pose is compared with the "
                       "true one nearest in time, without interpolation; one true pose may "
                       "serve several")
          ->check(at_least_zero())
          ->capture_default_str();
  command->add_option("--json", arguments->json, "write all figures to this file");
  command->add_option(
      "--plot", arguments->plot,
      "draw both paths from above, or the surface, coloured by error (red from --threshold on), "
      "to this PNG file");
  add_surface_options(command, difference, arguments);
  command->callback([arguments, &exit_code] {
    run_eval(*arguments);
    exit_code = kOk;
  });
}

}  // namespace twofold
