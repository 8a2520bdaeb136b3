#include "calibration/board.hpp"

#include <gtest/gtest.h>

#include <opencv2/aruco/charuco.hpp>

#include "fixtures/rendered_board.hpp"

namespace twofold {
namespace {

using namespace twofold::testing;

TEST(Board, TextIsReadOrRefusedWithTheReason) {
  const auto chessboard = parse_board("chessboard:9x6:0.025");
  ASSERT_TRUE(chessboard.has_value()) << chessboard.error();
  EXPECT_EQ(chessboard->corner_count(), 54);
  EXPECT_FLOAT_EQ(chessboard->corner(10).x, 0.025F);
  EXPECT_FLOAT_EQ(chessboard->corner(10).y, 0.025F);
  const auto charuco = parse_board("charuco:8x6:0.03:0.022:apriltag");
  ASSERT_TRUE(charuco.has_value()) << charuco.error();
  EXPECT_EQ(charuco->corner_count(), 35);
  EXPECT_EQ(charuco->family, MarkerFamily::kAprilTag36h11);
  for (const char* text :
       {"", "chess", "chessboard", "chessboard:9x6", "chessboard:9:0.02", "chessboard:9x2:0.02",
        "chessboard:9x6.5:0.02", "chessboard:9x6:0", "chessboard:9x6:nan", "chessboard:9x6:0.02:1",
        "charuco:8x6:0.03", "charuco:8x6:0.03:0.04", "charuco:8x6:0.03:0.02:7x7", "charuco:60x60:0.03:0.02",
        "chessboard::0.02", "chessboard:x:0.02"})
    EXPECT_FALSE(parse_board(text).has_value()) << text;
  for (const char* text :
       {"chessboard:9x6:25", "chessboard:9x6:2.5", "charuco:8x6:30:22", "chessboard:9x6:0.0002"})
    EXPECT_NE(parse_board(text).error().find("sides are in metres"), std::string::npos) << text;
  EXPECT_NE(parse_board("aprilgrid:6x6:0.088:0.3").error().find("no AprilGrid"), std::string::npos);
}

TEST(Board, ChessboardCornersAreFoundToAFractionOfAPixel) {
  const Board board = *parse_board("chessboard:9x6:0.025");
  const CameraModel model = test_camera(460, 324.3, 237.1, -0.28, 0.074, 0.0002, -0.0004);
  const BoardCamera camera(model);
  std::mt19937 random(1);
  const SE3 T_c_b(SO3::exp(Vector3(0.3, -0.4, 0.1)), Vector3(-0.1, -0.06, 0.33));
  const cv::Mat image = camera.see(print_chessboard(board), kPrintSquarePx / board.square,
                                   cv::Point2d(2 * kPrintSquarePx, 2 * kPrintSquarePx), T_c_b, random);
  const auto view = find_board(image, board);
  ASSERT_TRUE(view.has_value());
  double forwards = 0, backwards = 0;  // the board may be found turned round
  for (int id = 0; id < board.corner_count(); ++id) {
    const cv::Point3f p = board.corner(id);
    const Vector2 uv = model.project(T_c_b * Vector3(p.x, p.y, 0));
    const auto error = [&](int i) {
      const cv::Point2f& q = view->pixels[static_cast<std::size_t>(i)];
      return (Vector2(q.x, q.y) - uv).squaredNorm();
    };
    forwards += error(id);
    backwards += error(board.corner_count() - 1 - id);
  }
  EXPECT_LT(std::sqrt(std::min(forwards, backwards) / board.corner_count()), 0.12);
  EXPECT_FALSE(find_board(cv::Mat(480, 640, CV_8UC1, cv::Scalar(90)), board).has_value());
}

TEST(Board, PartOfACharucoBoardIsEnoughAndItsCornersKeepTheirNames) {
  const Board board = *parse_board("charuco:8x6:0.03:0.022");
  const auto printed = cv::aruco::CharucoBoard::create(
      8, 6, 0.03F, 0.022F, cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_250));
  cv::Mat print;
  printed->draw({8 * 60, 6 * 60}, print, 0);
  const CameraModel model = test_camera(460, 324.3, 237.1, -0.2, 0.05, 0, 0);
  std::mt19937 random(1);
  const double px_per_m = 60 / 0.03;
  // Most of the left half is outside of the image.
  const SE3 T_c_b(SO3::exp(Vector3(0.2, 0.25, 0.1)), Vector3(-0.26, -0.07, 0.28));
  const cv::Mat image = BoardCamera(model).see(print, px_per_m, {60, 60}, T_c_b, random);
  const auto view = find_board(image, board);
  ASSERT_TRUE(view.has_value());
  EXPECT_GE(view->ids.size(), 8U);
  EXPECT_LT(view->ids.size(), 35U);
  EXPECT_TRUE(std::is_sorted(view->ids.begin(), view->ids.end()));
  // Which side a ChArUco board is numbered from is OpenCV's choice: distances between named corners tell.
  const auto point = [&](std::size_t i) { return board.corner(view->ids[i]); };
  const cv::Point3f d = point(1) - point(0);
  EXPECT_NEAR(cv::norm(d), 0.03, 1e-6);
  const auto end = view->pixels.size() - 1;
  EXPECT_GT(cv::norm(view->pixels[end] - view->pixels[0]), 100);
}

}  // namespace
}  // namespace twofold
