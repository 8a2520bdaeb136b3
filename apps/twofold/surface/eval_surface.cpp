#include "apps/twofold/surface/eval_surface.hpp"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include <fmt/format.h>

#include "apps/twofold/surface/run_alignment.hpp"
#include "base/text_of_json.hpp"
#include "evaluation/evaluation.hpp"
#include "io/files/io_error.hpp"
#include "io/files/mesh_file.hpp"
#include "io/files/output_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/plots/plot.hpp"
#include "surface/comparison.hpp"
#include "surface/mesh_picture.hpp"
#include "surface/triangle_grid.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr int kPictureWidth = 1400;
constexpr std::int64_t kSameTimeNs = 10'000'000;

/// @param spacing  of the points that the surfaces are compared at [m]
TriangleMesh read_surface(const std::string& file, double spacing) {
  TriangleMesh mesh = read_ply_mesh(file);
  if (mesh.triangles.empty()) throw IoError(file, "holds no triangles");
  if (const std::string reason = too_large_reason(mesh, spacing); !reason.empty())
    throw IoError(file, reason);
  return mesh;
}

/// From the run's world to the truth's, by the trajectories that a run leaves beside its surface.
std::optional<RunAlignment> alignment_of(const fs::path& file, const TriangleMesh& estimate) {
  const fs::path own = file.parent_path() / "trajectory.txt";
  const fs::path truth = file.parent_path() / "groundtruth.txt";
  if (!fs::is_regular_file(own) || !fs::is_regular_file(truth)) return std::nullopt;
  const auto pairs = associate(read_trajectory(own), read_trajectory(truth), kSameTimeNs);
  if (pairs.empty())
    throw IoError(own, "cannot be aligned with the ground truth: no pose is close to one of it in time");
  auto alignment = align_run(pairs, viewing_distance(estimate, pairs));
  if (!alignment)
    throw IoError(
        own,
        "cannot be aligned with the ground truth: orientations contradict each other, and positions "
        "are too few, or all on one line");
  return alignment;
}

nlohmann::ordered_json to_json(const DistanceStatistics& s) {
  return {{"points", s.points}, {"mean_m", s.mean}, {"median_m", s.median},
          {"p95_m", s.p95},     {"rmse_m", s.rmse}, {"within_threshold", s.near}};
}

void print_row(const char* name, const DistanceStatistics& s) {
  fmt::print("{:<14} {:>9} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f} %\n", name, s.points, 1e3 * s.mean,
             1e3 * s.median, 1e3 * s.p95, 1e3 * s.rmse, 100 * s.near);
}

cv::Mat heat_map(TriangleMesh estimate, const SE3& T_w_e, const SurfaceComparison& comparison, double most) {
  const bool has_normals = estimate.normals.size() == estimate.positions.size();
  if (!has_normals) throw IoError("--plot", "needs an estimate with normals");
  for (Eigen::Vector3f& x : estimate.positions) x = (T_w_e * Vector3(x.cast<double>())).cast<float>();
  for (Eigen::Vector3f& n : estimate.normals) n = (T_w_e.rotation() * n.cast<double>()).cast<float>();
  const auto colours = error_colours(comparison.vertex_errors, most);
  return draw_mesh(estimate, colours, overview_of(estimate, Vector3::UnitZ(), kPictureWidth));
}

void print_notes(const SurfaceEvalArguments& arguments, const std::optional<RunAlignment>& alignment) {
  if (arguments.align && !alignment && !arguments.fit)
    fmt::print(stderr,
               "twofold: {}: is compared where it lies: its run's trajectory.txt and groundtruth.txt, which "
               "would move it onto the truth, are not beside it (copy both there; --align none if it lies "
               "right)\n",
               arguments.estimate);
  if (alignment && alignment->contradictory)
    fmt::print(stderr,
               "twofold: {}: is moved by its run's positions alone: orientations contradict the ground "
               "truth's\n",
               arguments.estimate);
  if (alignment && !alignment->by_positions)
    fmt::print(stderr,
               "twofold: {}: the path is so short or straight that the rotation that it is moved by rests on "
               "the run's orientations\n",
               arguments.estimate);
}

void print_comparison(const SurfaceEvalArguments& arguments, bool moved,
                      const SurfaceComparisonOptions& options, const SurfaceComparison& found) {
  fmt::print("{} against {}{}\n{}; points {:g} mm apart, distances cut at {:g} mm\n\n", arguments.estimate,
             arguments.truth, arguments.seen.empty() ? "" : ", as far as " + arguments.seen + " was seen",
             arguments.fit ? "moved so that the surfaces fit best"
             : moved       ? "moved as the run's poses onto the ground truth"
                           : "not moved",
             1e3 * options.spacing, 1e3 * kMostThresholds * options.threshold);
  fmt::print("{:<14} {:>9} {:>9} {:>9} {:>9} {:>9} {:>11}\n", "[mm]", "points", "mean", "median", "p95",
             "rmse", fmt::format("<= {:g} mm", 1e3 * arguments.threshold));
  print_row("accuracy", found.accuracy);
  print_row("completeness", found.completeness);
  fmt::print("F-score        {:.4f}\n", found.f_score);
}

}  // namespace

void eval_surface(const SurfaceEvalArguments& arguments) {
  const double spacing = 0.5 * arguments.threshold;
  const TriangleMesh estimate = read_surface(arguments.estimate, spacing);
  const TriangleMesh truth = read_surface(arguments.truth, spacing);
  const TriangleMesh seen = arguments.seen.empty() ? truth : read_surface(arguments.seen, spacing);
  std::optional<RunAlignment> alignment;
  if (arguments.align) alignment = alignment_of(arguments.estimate, estimate);
  std::optional<SE3> T_w_e;
  if (alignment) T_w_e = alignment->T_w_e;
  if (arguments.fit) T_w_e = fit_surface(estimate, T_w_e.value_or(SE3()), truth);
  SurfaceComparisonOptions options;
  options.threshold = arguments.threshold;
  options.spacing = spacing;
  const SurfaceComparison found = compare_surfaces(estimate, T_w_e.value_or(SE3()), truth, seen, options);
  print_comparison(arguments, T_w_e.has_value(), options, found);
  print_notes(arguments, alignment);
  if (!arguments.json.empty()) {
    const nlohmann::ordered_json json{{"estimate", arguments.estimate},
                                      {"truth", arguments.truth},
                                      {"seen", arguments.seen},
                                      {"aligned", T_w_e.has_value()},
                                      {"fitted", arguments.fit},
                                      {"threshold_m", arguments.threshold},
                                      {"accuracy", to_json(found.accuracy)},
                                      {"completeness", to_json(found.completeness)},
                                      {"f_score", found.f_score}};
    write_file(arguments.json, text_of_json(json, 2) + "\n");
  }
  if (!arguments.plot.empty()) {
    write_png(arguments.plot, heat_map(estimate, T_w_e.value_or(SE3()), found, arguments.threshold));
    fmt::print("picture in     {}, red from {:g} mm on\n", arguments.plot, 1e3 * arguments.threshold);
  }
}

}  // namespace twofold
