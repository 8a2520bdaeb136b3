#include "calibration/calibrate.hpp"

#include <csignal>

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <memory>

#include <fmt/format.h>

#include "apps/twofold/commands.hpp"
#include "calibration/view_guide.hpp"
#include "io/calibration_file.hpp"
#include "io/io_error.hpp"
#include "io/open_source.hpp"
#include "io/output_file.hpp"
#include "io/plot.hpp"
#include "io/raw_folder_source.hpp"
#include "io/residual_plot.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

struct CalibrateArguments {
  std::string source, out, board, residuals;
  int views = 20;
  bool quiet = false;
};

// A signal handler may touch a lock-free atomic; relaxed, because it carries no other data.
std::atomic<bool> interrupted{false};
void on_interrupt(int) {
  interrupted.store(true, std::memory_order_relaxed);
}

struct Collected {
  std::vector<ViewPair> chosen;  // right: empty for a single camera
  std::int64_t frames = 0, found = 0;
};

/// Tells the person with the board what is still missing, whenever that changes.
class Prompt {
 public:
  explicit Prompt(bool visible) : visible_(visible) {}
  void show(const ViewGuide& guide) {
    if (!visible_) return;
    const auto missing = guide.missing();
    const std::string text =
        fmt::format("{} views, corners in {:.0f} % of the image. {}", guide.chosen().size(),
                    100 * guide.coverage(), missing.empty() ? "complete" : "Next: " + missing[0]);
    if (text != shown_) fmt::print(stderr, "{}\n", text);
    shown_ = text;
  }

 private:
  bool visible_;
  std::string shown_;
};

/// Of a live board only: it moved so little since the frame before that it is not blurred, nor are the two
/// images of cameras without common trigger taken at noticeably different times.
bool holds_still(const std::optional<BoardView>& before, const BoardView& now, int width) {
  if (!before || before->ids != now.ids) return false;
  double most = 0;
  for (std::size_t i = 0; i < now.pixels.size(); ++i)
    most = std::max(most, cv::norm(now.pixels[i] - before->pixels[i]));
  return most < 0.002 * width;
}

std::optional<ViewPair> find_pair(const Frame& frame, const Board& board, bool stereo) {
  auto left = find_board(frame.left, board);
  if (!left) return std::nullopt;
  if (!stereo) return ViewPair{*std::move(left), {}};
  auto right = find_board(frame.right, board);
  if (!right) return std::nullopt;
  same_order(board, *left, &*right);
  return ViewPair{*std::move(left), *std::move(right)};
}

Collected collect(FrameSource& source, const Board& board, const CalibrateArguments& arguments) {
  const PinholeCamera& camera = source.rig().camera;
  ViewGuideOptions options;
  options.wanted_views = arguments.views;
  options.most_views = std::max(options.most_views, arguments.views);
  ViewGuide guide(board, {camera.width, camera.height}, options);
  Prompt prompt(!arguments.quiet);
  Collected collected;
  std::vector<ViewPair> offered;
  std::optional<BoardView> before;
  while (!interrupted.load(std::memory_order_relaxed)) {
    Frame frame;
    const FrameStatus status = source.next(frame);
    if (status == FrameStatus::kError) throw IoError("", source.error());
    if (status == FrameStatus::kEnd) break;
    ++collected.frames;
    auto pair = find_pair(frame, board, source.rig().kind == SensorKind::kStereo);
    if (!pair) {
      before.reset();
      continue;
    }
    ++collected.found;
    const bool usable = !source.is_live() || holds_still(before, pair->left, camera.width);
    before = pair->left;
    if (!usable) continue;
    (void)guide.offer(pair->left);
    offered.push_back(*std::move(pair));
    prompt.show(guide);
    if (source.is_live() && guide.missing().empty()) break;
  }
  for (const int number : guide.chosen())
    collected.chosen.push_back(offered[static_cast<std::size_t>(number)]);
  return collected;
}

std::unique_ptr<FrameSource> open_raw(const std::string& text) {
  if (!text.starts_with("v4l2:")) return std::make_unique<RawFolderSource>(text);
  SourceOptions options;
  options.raw = true;
  options.stop = &interrupted;
  return open_source(text, options);
}

ResidualPanel panel_of(const std::string& name, const CameraFit& fit) {
  const PinholeCamera& camera = fit.model.pinhole;
  ResidualPanel panel{fmt::format("{}: {} views, rms {:.3f} px", name, fit.used.size(), fit.rms_px),
                      {camera.width, camera.height},
                      {},
                      {}};
  for (const ViewResiduals& view : fit.residuals) {
    panel.pixels.insert(panel.pixels.end(), view.pixels.begin(), view.pixels.end());
    panel.residuals.insert(panel.residuals.end(), view.residuals.begin(), view.residuals.end());
  }
  return panel;
}

void print_camera(const std::string& name, const CameraFit& fit) {
  const PinholeCamera& c = fit.model.pinhole;
  const auto& k = fit.model.distortion.coefficients;
  fmt::print("{:<8} fx {:.2f} +- {:.2f}  fy {:.2f} +- {:.2f}  cx {:.2f} +- {:.2f}  cy {:.2f} +- {:.2f}\n",
             name, c.fx, fit.fx_std, c.fy, fit.fy_std, c.cx, fit.cx_std, c.cy, fit.cy_std);
  fmt::print("         k1 {:.5f}  k2 {:.5f}  p1 {:.5f}  p2 {:.5f}\n", k[0], k[1], k[2], k[3]);
  fmt::print("         {} views, corners in {:.0f} % of the image, reprojection error {:.3f} px\n",
             fit.used.size(), 100 * fit.coverage, fit.rms_px);
}

double focal_std(const CameraFit& fit) {
  return std::max(fit.fx_std, fit.fy_std);
}

void finish(const CalibrateArguments& arguments, const Calibration& calibration,
            const CalibrationQuality& quality, const std::vector<ResidualPanel>& panels) {
  const fs::path picture = arguments.residuals.empty() ? fs::path(arguments.out).replace_extension(".png")
                                                       : fs::path(arguments.residuals);
  write_calibration(arguments.out, calibration, quality);
  write_png(picture, draw_residuals(panels));
  fmt::print("written to {}, residuals drawn in {}\n", arguments.out, picture.string());
}

[[noreturn]] void refuse(const std::string& reason) {
  throw std::runtime_error("no calibration: " + reason);
}

void finish_mono(const CalibrateArguments& arguments, const Board& board, cv::Size size,
                 const Collected& collected) {
  std::vector<BoardView> views;
  for (const ViewPair& pair : collected.chosen) views.push_back(pair.left);
  const auto fit = calibrate_camera(views, board, size);
  if (!fit) refuse(fit.error());
  Calibration calibration;
  calibration.kind = SensorKind::kMono;
  calibration.left = fit->model;
  print_camera("camera", *fit);
  finish(arguments, calibration,
         {arguments.board, static_cast<int>(fit->used.size()), fit->rms_px, focal_std(*fit), std::nullopt},
         {panel_of("camera", *fit)});
}

void finish_stereo(const CalibrateArguments& arguments, const Board& board, cv::Size size,
                   const Collected& collected) {
  const auto fit = calibrate_stereo(collected.chosen, board, size);
  if (!fit) refuse(fit.error());
  print_camera("left", fit->left);
  print_camera("right", fit->right);
  fmt::print("baseline {:.5f} m +- {:.5f}\n", fit->calibration.T_right_left.translation().norm(),
             fit->baseline_std);
  finish(arguments, fit->calibration,
         {arguments.board, static_cast<int>(fit->left.used.size()), fit->rms_px,
          std::max(focal_std(fit->left), focal_std(fit->right)), fit->baseline_std},
         {panel_of("left", fit->left), panel_of("right", fit->right)});
}

int calibrate(const CalibrateArguments& arguments) {
  const auto board = parse_board(arguments.board);
  if (!board) throw IoError("--board", board.error());
  const fs::path folder = fs::path(arguments.out).parent_path();
  if (!folder.empty()) prepare_output_folder(folder);
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
  const auto source = open_raw(arguments.source);
  const cv::Size size(source->rig().camera.width, source->rig().camera.height);
  const Collected collected = collect(*source, *board, arguments);
  fmt::print("{} frames, the board found in {}, {} views chosen\n", collected.frames, collected.found,
             collected.chosen.size());
  if (collected.found == 0) refuse("the board was never seen whole; is --board right?");
  switch (source->rig().kind) {
    case SensorKind::kStereo:
      finish_stereo(arguments, *board, size, collected);
      break;
    case SensorKind::kMono:
      finish_mono(arguments, *board, size, collected);
      break;
    case SensorKind::kRgbd:
      throw IoError(arguments.source, "is a depth camera; calibrate its grey camera alone");
  }
  return kOk;
}

}  // namespace

void add_calibrate_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<CalibrateArguments>();
  CLI::App* command =
      app.add_subcommand("calibrate", "Calibrate a camera or a stereo pair with a printed board");
  command
      ->add_option("SOURCE", arguments->source,
                   "v4l2:..., a folder of images, one with left/ and right/, or a recording")
      ->required();
  command->add_option("-o,--out", arguments->out, "Calibration file to write")->required();
  command
      ->add_option("--board", arguments->board,
                   "chessboard:9x6:0.025 (inner corners, side of a square [m]) or charuco:8x6:0.03:0.022")
      ->required();
  command->add_option("--views", arguments->views, "Different views wanted from a camera")
      ->check(CLI::Range(10, 200))
      ->capture_default_str();
  command->add_option("--residuals", arguments->residuals, "Picture of the residuals (default: FILE.png)");
  command->add_flag("--quiet", arguments->quiet, "Do not say which view is missing");
  command->callback([arguments, &exit_code] { exit_code = calibrate(*arguments); });
}

}  // namespace twofold
