#include "calibration/calibrate.hpp"

#include <gtest/gtest.h>

#include "fixtures/rendered_board.hpp"

namespace twofold {
namespace {

using namespace twofold::testing;

constexpr int kViews = 30;

CameraModel left_camera() {
  return test_camera(460, 324.3, 237.1, -0.28, 0.074, 0.0002, -0.0004);
}
CameraModel right_camera() {
  return test_camera(457, 315.6, 243.8, -0.27, 0.069, -0.0003, 0.0003);
}
SE3 T_right_left() {
  return SE3(SO3::exp(Vector3(0.004, -0.012, 0.006)), Vector3(-0.08, 0.0011, -0.0007));
}

/// Rendered once for all tests: kViews pairs of images, board found in both.
const std::vector<ViewPair>& rendered_pairs() {
  static const std::vector<ViewPair> pairs = [] {
    const BoardCamera left(left_camera()), right(right_camera());
    const cv::Mat print = print_chessboard(kBoard);
    const double px_per_m = kPrintSquarePx / kBoard.square;
    const cv::Point2d origin(2 * kPrintSquarePx, 2 * kPrintSquarePx);
    std::mt19937 random(3);
    std::vector<ViewPair> found;
    while (static_cast<int>(found.size()) < kViews) {
      const SE3 T_l_b = random_pose(kBoard, 0.6, random);
      const SE3 T_r_b = T_right_left() * T_l_b;
      if (!sees(left_camera(), kBoard, T_l_b) || !sees(right_camera(), kBoard, T_r_b)) continue;
      auto seen_left = find_board(left.see(print, px_per_m, origin, T_l_b, random), kBoard);
      auto seen_right = find_board(right.see(print, px_per_m, origin, T_r_b, random), kBoard);
      if (!seen_left || !seen_right) continue;
      same_order(kBoard, *seen_left, &*seen_right);
      found.push_back({*seen_left, *seen_right});
    }
    return found;
  }();
  return pairs;
}

std::vector<BoardView> rendered_views() {
  std::vector<BoardView> views;
  for (const ViewPair& pair : rendered_pairs()) views.push_back(pair.left);
  return views;
}

/// Exact projections with noise, without images: for what depends on the poses alone.
BoardView projected(const SE3& T_c_b, double noise_px, std::mt19937& random) {
  std::normal_distribution<double> noise(0, noise_px);
  BoardView view;
  for (int id = 0; id < kBoard.corner_count(); ++id) {
    const cv::Point3f p = kBoard.corner(id);
    const Vector2 uv = left_camera().project(T_c_b * Vector3(p.x, p.y, 0));
    view.ids.push_back(id);
    view.pixels.emplace_back(static_cast<float>(uv.x() + noise(random)),
                             static_cast<float>(uv.y() + noise(random)));
  }
  return view;
}

std::vector<BoardView> projected_views(int count, double max_tilt, double noise_px, unsigned seed = 5) {
  std::mt19937 random(seed);
  std::vector<BoardView> views;
  while (static_cast<int>(views.size()) < count) {
    const SE3 T_c_b = random_pose(kBoard, max_tilt, random);
    if (sees(left_camera(), kBoard, T_c_b)) views.push_back(projected(T_c_b, noise_px, random));
  }
  return views;
}

void expect_refused(const std::vector<BoardView>& views, const std::string& part,
                    const CalibrationOptions& options = {}) {
  const auto fit = calibrate_camera(views, kBoard, kImageSize, options);
  ASSERT_FALSE(fit.has_value()) << "not refused: " << part;
  EXPECT_NE(fit.error().find(part), std::string::npos) << fit.error();
}

TEST(Calibrate, RecoversADistortingCameraFromRenderedViews) {
  const auto fit = calibrate_camera(rendered_views(), kBoard, kImageSize);
  ASSERT_TRUE(fit.has_value()) << fit.error();
  const PinholeCamera truth = left_camera().pinhole, found = fit->model.pinhole;
  SCOPED_TRACE(::testing::Message() << "rms " << fit->rms_px << " px, fx " << found.fx << " +- "
                                    << fit->fx_std);
  RecordProperty("fx_error_percent", std::to_string(100 * (found.fx / truth.fx - 1)));
  EXPECT_NEAR(found.fx / truth.fx, 1, 0.002);
  EXPECT_NEAR(found.fy / truth.fy, 1, 0.002);
  EXPECT_NEAR(found.cx, truth.cx, 1);
  EXPECT_NEAR(found.cy, truth.cy, 1);
  EXPECT_LT(fit->rms_px, 0.2);
  // The standard deviations mean something: the error is not many of them.
  EXPECT_LT(std::abs(found.fx - truth.fx), 5 * fit->fx_std);
  // What counts of a lens is where points land, not each coefficient.
  for (const Vector2& uv : {Vector2(20, 20), Vector2(620, 30), Vector2(40, 450), Vector2(600, 460)}) {
    const Vector3 ray = *left_camera().unproject(uv);
    EXPECT_LT((fit->model.project(ray) - uv).norm(), 1.0) << uv.transpose();
  }
}

TEST(Calibrate, RecoversTheBaselineFromRenderedPairs) {
  const auto fit = calibrate_stereo(rendered_pairs(), kBoard, kImageSize);
  ASSERT_TRUE(fit.has_value()) << fit.error();
  const double baseline = T_right_left().translation().norm();
  RecordProperty("baseline_error_percent",
                 std::to_string(100 * (fit->calibration.T_right_left.translation().norm() / baseline - 1)));
  EXPECT_NEAR(fit->calibration.T_right_left.translation().norm() / baseline, 1, 0.005);
  EXPECT_LT((fit->calibration.T_right_left.rotation() - T_right_left().rotation()).norm(), 0.002);
  EXPECT_NEAR(fit->calibration.left.pinhole.fx / left_camera().pinhole.fx, 1, 0.002);
  EXPECT_NEAR(fit->calibration.right.pinhole.fx / right_camera().pinhole.fx, 1, 0.002);
  EXPECT_LT(fit->rms_px, 0.2);
  EXPECT_EQ(fit->calibration.invalid_reason(), "");
}

/// What both see of a ChArUco board may be one row, which says nothing of how the board is turned about it.
TEST(Calibrate, LeavesOutAPairWhoseCommonCornersLieInOneLine) {
  std::vector<ViewPair> pairs = rendered_pairs();
  const auto keep = [](int first_row, int last_row, BoardView& view) {
    BoardView part;
    for (std::size_t i = 0; i < view.ids.size(); ++i) {
      const int row = view.ids[i] / kBoard.corners_a_row();
      if (row < first_row || row > last_row) continue;
      part.ids.push_back(view.ids[i]);
      part.pixels.push_back(view.pixels[i]);
    }
    view = part;
  };
  for (const std::size_t v : {4U, 12U, 17U}) {
    keep(0, 2, pairs[v].left);
    keep(2, 5, pairs[v].right);
  }
  const auto fit = calibrate_stereo(pairs, kBoard, kImageSize);
  ASSERT_TRUE(fit.has_value()) << fit.error();
  const double baseline = T_right_left().translation().norm();
  EXPECT_NEAR(fit->calibration.T_right_left.translation().norm() / baseline, 1, 0.005);
  EXPECT_LT(fit->rms_px, 0.2);
}

TEST(Calibrate, LeavesOutAViewThatIsWrong) {
  std::vector<BoardView> views = projected_views(20, 0.6, 0.05);
  for (std::size_t i = 0; i < views[7].pixels.size(); i += 2) views[7].pixels[i].x += 4;
  const auto fit = calibrate_camera(views, kBoard, kImageSize);
  ASSERT_TRUE(fit.has_value()) << fit.error();
  EXPECT_EQ(fit->used.size(), 19U);
  EXPECT_EQ(std::count(fit->used.begin(), fit->used.end(), 7), 0);
  EXPECT_NEAR(fit->model.pinhole.fx, 460, 0.9);
}

TEST(Calibrate, RefusesTooFewViews) {
  expect_refused(projected_views(9, 0.6, 0.05), "too few views: 9");
  expect_refused({}, "too few views: 0");
}

TEST(Calibrate, RefusesViewsOfTheMiddleOnly) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<BoardView> views;
  for (int i = 0; i < 20; ++i) {
    const SO3 R = SO3::exp(0.5 * Vector3(unit(random), unit(random), 0));
    const SE3 T_c_b(
        R, Vector3(0.02 * unit(random), 0.02 * unit(random), 0.7) - R.matrix() * Vector3(0.1, 0.0625, 0));
    views.push_back(projected(T_c_b, 0.05, random));
  }
  expect_refused(views, "poor coverage");
}

TEST(Calibrate, RefusesABoardThatWasNeverTilted) {
  expect_refused(projected_views(20, 0.0, 0.05), "degenerate");
  expect_refused(projected_views(20, 0.04, 0.05), "degenerate");
}

TEST(Calibrate, RefusesAHighReprojectionError) {
  expect_refused(projected_views(20, 0.6, 1.0), "high reprojection error");
  const Board narrow{BoardKind::kChessboard, 6, 9, 0.025, 0,
                     MarkerFamily::k4x4};  // rows and columns confused
  const auto fit = calibrate_camera(projected_views(20, 0.6, 0.05), narrow, kImageSize);
  EXPECT_FALSE(fit.has_value());
}

TEST(Calibrate, RefusesAnUncertainFocalLength) {
  CalibrationOptions options;  // little noise can be seen, so much noise and few views must be let through
  options.max_rms_px = 10;
  options.min_tilted = 0;
  options.min_coverage = 0;
  expect_refused(projected_views(10, 0.1, 0.6), "focal length uncertain", options);
}

TEST(Calibrate, RefusesPairsWhoseImagesDoNotBelongTogether) {
  std::vector<ViewPair> pairs = rendered_pairs();
  const BoardView first = pairs.front().right;
  for (std::size_t i = 0; i + 1 < pairs.size(); ++i) pairs[i].right = pairs[i + 1].right;
  pairs.back().right = first;
  const auto fit = calibrate_stereo(pairs, kBoard, kImageSize);
  ASSERT_FALSE(fit.has_value());
  EXPECT_NE(fit.error().find("both cameras together: high reprojection error"), std::string::npos)
      << fit.error();
  pairs.resize(5);
  EXPECT_NE(calibrate_stereo(pairs, kBoard, kImageSize).error().find("left camera: too few views"),
            std::string::npos);
}

}  // namespace
}  // namespace twofold
