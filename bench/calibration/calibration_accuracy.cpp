// How well cameras of known lenses are recovered from rendered views of a board: another stereo pair, other
// views and other noise for every seed. Fails when a focal length is off by more than 0.2 % or a baseline by
// more than 0.5 %.
#include <CLI/CLI.hpp>
#include <opencv2/aruco/charuco.hpp>

#include <fmt/format.h>

#include "calibration/calibrate.hpp"
#include "fixtures/rendered_board.hpp"

namespace twofold {
namespace {

using namespace twofold::testing;

constexpr double kFocalBound = 0.2, kBaselineBound = 0.5;  // [%]
constexpr double kMostTilt = 0.6;                          // [rad]

struct Print {
  cv::Mat image;
  double px_per_m = 0;
  cv::Point2d origin;  // of corner 0 [px]
};

Print print_of(const Board& board) {
  if (board.kind == BoardKind::kChessboard)
    return {
        print_chessboard(board), kPrintSquarePx / board.square, {2.0 * kPrintSquarePx, 2.0 * kPrintSquarePx}};
  constexpr int kSquarePx = 60;
  const bool tags = board.family == MarkerFamily::kAprilTag36h11;
  const auto charuco = cv::aruco::CharucoBoard::create(
      board.columns, board.rows, static_cast<float>(board.square), static_cast<float>(board.marker),
      cv::aruco::getPredefinedDictionary(tags ? cv::aruco::DICT_APRILTAG_36h11 : cv::aruco::DICT_4X4_250));
  Print print{{}, kSquarePx / board.square, {kSquarePx, kSquarePx}};
  charuco->draw({board.columns * kSquarePx, board.rows * kSquarePx}, print.image, 0);
  return print;
}

struct Pair {
  CameraModel left, right;
  SE3 T_r_l;
};

/// Ordinary wide lenses, from hardly to strongly distorting; the second differs a little from the first.
Pair random_pair(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  const double f = 470 + 90 * unit(random), k1 = -0.18 + 0.14 * unit(random);
  const auto camera = [&] {
    const double k = k1 + 0.01 * unit(random);
    return test_camera(f + 4 * unit(random), 319.5 + 12 * unit(random), 239.5 + 12 * unit(random), k,
                       0.9 * k * k, 5e-4 * unit(random), 5e-4 * unit(random));
  };
  Pair pair{camera(), camera(), {}};
  pair.T_r_l = SE3(SO3::exp(0.01 * Vector3(unit(random), unit(random), unit(random))),
                   Vector3(-0.085 + 0.025 * unit(random), 0.001 * unit(random), 0.001 * unit(random)));
  return pair;
}

std::vector<ViewPair> render_views(const Pair& pair, const Board& board, const Print& print, int count,
                                   std::mt19937& random) {
  const BoardCamera left(pair.left), right(pair.right);
  std::vector<ViewPair> views;
  while (static_cast<int>(views.size()) < count) {
    const SE3 T_l_b = random_pose(board, kMostTilt, random);
    const SE3 T_r_b = pair.T_r_l * T_l_b;
    if (!sees(pair.left, board, T_l_b) || !sees(pair.right, board, T_r_b)) continue;
    const auto find = [&](const BoardCamera& camera, const SE3& T_c_b) {
      return find_board(camera.see(print.image, print.px_per_m, print.origin, T_c_b, random), board);
    };
    const auto in_left = find(left, T_l_b);
    auto in_right = find(right, T_r_b);
    if (!in_left || !in_right) continue;
    same_order(board, *in_left, &*in_right);
    views.push_back({*in_left, *in_right});
  }
  return views;
}

double percent(double found, double truth) {
  return 100 * std::abs(found / truth - 1);
}

double focal_error(const CameraModel& found, const CameraModel& truth) {
  return std::max(percent(found.pinhole.fx, truth.pinhole.fx), percent(found.pinhole.fy, truth.pinhole.fy));
}

/// Worst errors of all seeds [%]; infinite when a calibration was refused.
struct Worst {
  double focal = 0, baseline = 0;
};

Worst measure(const std::string& text, int seeds, int views) {
  const auto board = parse_board(text);
  if (!board) throw std::runtime_error(board.error());
  const Print print = print_of(*board);
  Worst worst;
  fmt::print("{}, {} pairs of views a seed\nseed   focal [%]  baseline [%]  rms [px]\n", text, views);
  for (int seed = 1; seed <= seeds; ++seed) {
    std::mt19937 random(static_cast<unsigned>(seed));
    const Pair truth = random_pair(random);
    const auto fit = calibrate_stereo(render_views(truth, *board, print, views, random), *board, {640, 480});
    if (!fit) {
      fmt::print("{:>4}   refused: {}\n", seed, fit.error());
      worst.focal = worst.baseline = std::numeric_limits<double>::infinity();
      continue;
    }
    const Calibration& found = fit->calibration;
    const double focal = std::max(focal_error(found.left, truth.left), focal_error(found.right, truth.right));
    const double baseline =
        percent(found.T_right_left.translation().norm(), truth.T_r_l.translation().norm());
    fmt::print("{:>4}      {:.4f}        {:.4f}    {:.3f}\n", seed, focal, baseline, fit->rms_px);
    std::fflush(stdout);
    worst.focal = std::max(worst.focal, focal);
    worst.baseline = std::max(worst.baseline, baseline);
  }
  fmt::print("worst     {:.4f}        {:.4f}\n\n", worst.focal, worst.baseline);
  return worst;
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app{"Accuracy of calibration over several seeds"};
  std::vector<std::string> boards{"chessboard:9x6:0.025", "charuco:8x6:0.03:0.022",
                                  "charuco:8x6:0.03:0.022:apriltag"};
  int seeds = 10, views = 30;
  app.add_option("--board", boards, "As of twofold calibrate")->capture_default_str();
  app.add_option("--seeds", seeds)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--views", views)->check(CLI::PositiveNumber)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  bool within = true;
  for (const std::string& board : boards) {
    const twofold::Worst worst = twofold::measure(board, seeds, views);
    within &= worst.focal <= twofold::kFocalBound && worst.baseline <= twofold::kBaselineBound;
  }
  return within ? 0 : 1;
}
