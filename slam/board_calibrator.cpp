#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/option_check.hpp"
#include "calibration/calibrate.hpp"
#include "calibration/view_collector.hpp"
#include "io/files/calibration_file.hpp"
#include "slam/conversions.hpp"
#include "slam/frame_pixels.hpp"
#include "twofold/calibration.hpp"

namespace twofold {
namespace {

CalibratedCamera camera_of(const CameraFit& fit) {
  const PinholeCamera& c = fit.model.pinhole;
  CalibratedCamera camera{c.width, c.height,   c.fx,       c.fy,       c.cx,
                          c.cy,    fit.fx_std, fit.fy_std, fit.cx_std, fit.cy_std};
  const auto& k = fit.model.distortion.coefficients;
  std::copy_n(k.begin(), camera.distortion.size(), camera.distortion.begin());
  camera.rms_px = fit.rms_px;
  camera.coverage = fit.coverage;
  camera.views = static_cast<int>(fit.used.size());
  for (const ViewResiduals& view : fit.residuals) {
    for (std::size_t i = 0; i < view.pixels.size(); ++i)
      camera.corners.push_back(
          {view.pixels[i].x, view.pixels[i].y, view.residuals[i].x, view.residuals[i].y});
  }
  return camera;
}

double focal_std(const CalibratedCamera& camera) {
  return std::max(camera.fx_std, camera.fy_std);
}

Board board_of(const BoardCalibrator::Options& options) {
  if (const std::string why = options.invalid_reason(); !why.empty())
    throw std::invalid_argument("options." + why);
  return *parse_board(options.board);
}

ViewGuideOptions guide_options(int views) {
  ViewGuideOptions options;
  options.wanted_views = views;
  options.max_views = std::max(options.max_views, views);
  return options;
}

cv::Mat image_of(const char* name, const FrameView& frame, const ImageView& view, cv::Size size) {
  if (const std::string why = pixels_refusal(name, view, false); !why.empty())
    throw std::invalid_argument(why);
  if (view.width != size.width || view.height != size.height)
    throw std::invalid_argument(fmt::format("the {} image is {}x{}, expected are {}x{}", name, view.width,
                                            view.height, size.width, size.height));
  return pixels_of(view, frame.owner);
}

}  // namespace

std::string BoardCalibrator::Options::invalid_reason() const {
  const auto its_board = parse_board(board);
  return OptionCheck()
      .rule(its_board.has_value(), its_board ? "" : "board: " + its_board.error())
      .at_least("width", width, 1)
      .at_least("height", height, 1)
      .within("views", views, 10, 200)
      .reason();
}

struct TWOFOLD_HIDDEN BoardCalibrator::Impl {
  explicit Impl(const Options& given)
      : options(given),
        board(board_of(given)),
        size(given.width, given.height),
        collector(board, {size, given.stereo, given.live}, guide_options(given.views)) {}

  [[nodiscard]] BoardCalibration calibrate_one(const std::vector<ViewPair>& pairs) const {
    std::vector<BoardView> views;
    views.reserve(pairs.size());
    for (const ViewPair& pair : pairs) views.push_back(pair.left);
    const auto fit = calibrate_camera(views, board, size);
    if (!fit) refuse(fit.error());
    BoardCalibration result{options.board, camera_of(*fit)};
    result.rms_px = fit->rms_px;
    return result;
  }
  [[nodiscard]] BoardCalibration calibrate_pair(const std::vector<ViewPair>& pairs) const {
    const auto fit = calibrate_stereo(pairs, board, size);
    if (!fit) refuse(fit.error());
    const SE3& T_right_left = fit->calibration.T_right_left;
    return {options.board,
            camera_of(fit->left),
            camera_of(fit->right),
            to_pose(T_right_left),
            T_right_left.translation().norm(),
            fit->baseline_std,
            fit->rms_px};
  }
  [[noreturn]] void refuse(const std::string& reason) const {
    throw std::runtime_error(
        fmt::format("no calibration: {} ({} frames, the board found in {}, {} views chosen)", reason,
                    collector.frames(), collector.found(), collector.chosen().size()));
  }

  const Options options;
  const Board board;
  const cv::Size size;
  ViewCollector collector;
};

BoardCalibrator::BoardCalibrator(const Options& options) : impl_(std::make_unique<Impl>(options)) {}
BoardCalibrator::~BoardCalibrator() = default;
BoardCalibrator::BoardCalibrator(BoardCalibrator&&) noexcept = default;
BoardCalibrator& BoardCalibrator::operator=(BoardCalibrator&&) noexcept = default;

void BoardCalibrator::look(const FrameView& raw) {
  Frame frame;
  frame.t_ns = raw.t_ns;
  frame.left = image_of("left", raw, raw.left, impl_->size);
  if (impl_->options.stereo) frame.right = image_of("right", raw, raw.right, impl_->size);
  impl_->collector.look(frame);
}

bool BoardCalibrator::complete() const {
  return impl_->collector.complete();
}
std::string BoardCalibrator::progress() const {
  return impl_->collector.progress();
}
std::int64_t BoardCalibrator::frames() const {
  return impl_->collector.frames();
}
std::int64_t BoardCalibrator::found() const {
  return impl_->collector.found();
}
int BoardCalibrator::chosen() const {
  return static_cast<int>(impl_->collector.chosen().size());
}

BoardCalibration BoardCalibrator::calibrate() const {
  if (found() == 0) impl_->refuse("the board was never seen; is it the one that was named?");
  const std::vector<ViewPair> pairs = impl_->collector.chosen();
  return impl_->options.stereo ? impl_->calibrate_pair(pairs) : impl_->calibrate_one(pairs);
}

void save_calibration(const BoardCalibration& calibration, const std::filesystem::path& file) {
  const Calibration written = to_calibration(calibration);
  CalibrationQuality quality{calibration.board, calibration.left.views, calibration.rms_px,
                             focal_std(calibration.left), std::nullopt};
  if (calibration.right) {
    quality.focal_std_px = std::max(quality.focal_std_px, focal_std(*calibration.right));
    quality.baseline_std = calibration.baseline_std;
  }
  expect_valid(file, written);
  write_calibration(file, written, quality);
}

}  // namespace twofold
