#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

namespace twofold {

enum class BoardKind : std::uint8_t { kChessboard, kCharuco };
enum class MarkerFamily : std::uint8_t { k4x4, k5x5, k6x6, kAprilTag36h11 };

/// A flat calibration board. Its frame: origin at corner 0, x along a row, y along a column, z = 0.
struct Board {
  BoardKind kind = BoardKind::kChessboard;
  int columns = 9, rows = 6;  ///< chessboard: inner corners; ChArUco: squares
  double square = 0.025;      ///< side of a square [m]
  double marker = 0;          ///< ChArUco: side of a marker [m], < square
  MarkerFamily family = MarkerFamily::k4x4;

  [[nodiscard]] int corners_a_row() const { return kind == BoardKind::kCharuco ? columns - 1 : columns; }
  [[nodiscard]] int corner_rows() const { return kind == BoardKind::kCharuco ? rows - 1 : rows; }
  [[nodiscard]] int corner_count() const { return corners_a_row() * corner_rows(); }
  /// Corner `id` in the board's frame [m], numbered along the rows.
  [[nodiscard]] cv::Point3f corner(int id) const;
};

/// "chessboard:9x6:0.025" (inner corners, square [m]) or "charuco:8x6:0.03:0.022[:4x4|5x5|6x6|apriltag]"
/// (squares, square and marker [m], a square from 0.001 to 0.9). Error: what is wrong with the text.
[[nodiscard]] tl::expected<Board, std::string> parse_board(const std::string& text);

/// Corners of a board found in one image; ids ascending and different.
struct BoardView {
  std::vector<int> ids;
  std::vector<cv::Point2f> pixels;
};

/// Finds the board in a CV_8UC1 image and its corners to a few hundredths of a pixel. A chessboard is found
/// whole or not at all; of a ChArUco board four corners that are not in one line do. Nothing when it is not
/// there.
///
/// Which end of a chessboard is corner 0 is not known where it looks the same turned round: see same_order.
[[nodiscard]] std::optional<BoardView> find_board(const cv::Mat& image, const Board& board);

/// Makes corner 0 of a chessboard the same one in both images of a stereo pair, whose cameras must be turned
/// against each other by less than 90 degrees about their axes. Leaves ChArUco views alone: their corners
/// have names.
void same_order(const Board& board, const BoardView& left, BoardView* right);

}  // namespace twofold
