#include "calibration/board.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include <fmt/format.h>

namespace twofold {
namespace {

const std::map<std::string, MarkerFamily> kFamilies{{"4x4", MarkerFamily::k4x4},
                                                    {"5x5", MarkerFamily::k5x5},
                                                    {"6x6", MarkerFamily::k6x6},
                                                    {"apriltag", MarkerFamily::kAprilTag36h11}};

// What can be printed and seen [m]. Sides in millimetres or centimetres are beyond.
constexpr double kSmallestSquare = 0.001;
constexpr double kLargestSquare = 0.9;

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

/// The whole text as a number; nothing when it is not one.
std::optional<double> number(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value)) return std::nullopt;
  return value;
}

cv::Ptr<cv::aruco::CharucoBoard> charuco_of(const Board& board) {
  static const std::map<MarkerFamily, int> kDictionaries{
      {MarkerFamily::k4x4, cv::aruco::DICT_4X4_250},
      {MarkerFamily::k5x5, cv::aruco::DICT_5X5_250},
      {MarkerFamily::k6x6, cv::aruco::DICT_6X6_250},
      {MarkerFamily::kAprilTag36h11, cv::aruco::DICT_APRILTAG_36h11}};
  return cv::aruco::CharucoBoard::create(board.columns, board.rows, static_cast<float>(board.square),
                                         static_cast<float>(board.marker),
                                         cv::aruco::getPredefinedDictionary(kDictionaries.at(board.family)));
}

/// Shortest distance between neighbours of one row of the board [px]; 0 when no two are seen.
double spacing_px(const BoardView& view, const Board& board) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < view.ids.size(); ++i) {
    const bool neighbours = view.ids[i] == view.ids[i - 1] + 1 && view.ids[i] % board.corners_a_row() != 0;
    if (neighbours) least = std::min(least, cv::norm(view.pixels[i] - view.pixels[i - 1]));
  }
  return std::isfinite(least) ? least : 0;
}

/// Places the corners by the gradients around each, to where it settles. `reach`: how far around a corner
/// there is nothing but its four squares [px].
void settle_corners(const cv::Mat& image, double reach, BoardView* view) {
  const int half = std::clamp(static_cast<int>(reach), 2, 7);
  cv::cornerSubPix(image, view->pixels, {half, half}, {-1, -1},
                   cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 40, 1e-3));
}

std::optional<BoardView> find_chessboard(const cv::Mat& image, const Board& board) {
  BoardView view;
  if (!cv::findChessboardCornersSB(image, {board.columns, board.rows}, view.pixels,
                                   cv::CALIB_CB_NORMALIZE_IMAGE)) {
    return std::nullopt;
  }
  for (int id = 0; id < board.corner_count(); ++id) view.ids.push_back(id);
  // Found by lines, which the lens bends.
  settle_corners(image, 0.3 * spacing_px(view, board), &view);
  return view;
}

std::optional<BoardView> find_charuco(const cv::Mat& image, const Board& board) {
  const auto charuco = charuco_of(board);
  auto parameters = cv::aruco::DetectorParameters::create();
  std::vector<std::vector<cv::Point2f>> markers;
  std::vector<int> marker_ids;
  cv::aruco::detectMarkers(image, charuco->dictionary, markers, marker_ids, parameters);
  if (marker_ids.empty()) return std::nullopt;
  BoardView view;
  cv::aruco::interpolateCornersCharuco(markers, marker_ids, image, charuco, view.pixels, view.ids);
  if (view.ids.size() < 4 || cv::aruco::testCharucoCornersCollinear(charuco, view.ids)) return std::nullopt;
  // OpenCV's own refinement stops at steps of 0.1 px. The markers beside a corner must stay outside.
  const double rim = 0.5 * (board.square - board.marker) / board.square;
  settle_corners(image, rim * spacing_px(view, board) - 1, &view);
  return view;
}

}  // namespace

cv::Point3f Board::corner(int id) const {
  const int row = id / corners_a_row(), column = id % corners_a_row();
  return {static_cast<float>(column * square), static_cast<float>(row * square), 0};
}

namespace {

/// Columns and rows, as "9x6". Empty, or what is wrong, as below.
std::string read_counts(const std::string& text, Board* board) {
  const auto counts = split(text, 'x');
  const auto columns = number(counts.empty() ? "" : counts[0]),
             rows = number(counts.size() == 2 ? counts[1] : "");
  if (!columns || !rows || *columns < 3 || *rows < 3 || *columns > 100 || *rows > 100 ||
      *columns != std::floor(*columns) || *rows != std::floor(*rows))
    return fmt::format("'{}' is not two whole numbers from 3 to 100 like 9x6", text);
  board->columns = static_cast<int>(*columns);
  board->rows = static_cast<int>(*rows);
  return "";
}

std::string read_square(const std::string& text, Board* board) {
  const auto square = number(text);
  if (!square || !(*square > 0)) return fmt::format("'{}' is no side of a square [m]", text);
  if (*square < kSmallestSquare || *square > kLargestSquare)
    return fmt::format("squares of {} m: sides are in metres, from {} to {}, as 0.03 for 30 mm", text,
                       kSmallestSquare, kLargestSquare);
  board->square = *square;
  return "";
}

/// @param parts  behind the first three: side, and the family, which may be left out
std::string read_markers(const std::vector<std::string>& parts, Board* board) {
  const auto marker = number(parts[3]);
  if (!marker || !(*marker > 0 && *marker < board->square))
    return fmt::format("'{}' is no side of a marker smaller than a square [m]", parts[3]);
  board->marker = *marker;
  if (parts.size() == 5) {
    const auto family = kFamilies.find(parts[4]);
    if (family == kFamilies.end()) return fmt::format("'{}' is not 4x4, 5x5, 6x6 or apriltag", parts[4]);
    board->family = family->second;
  }
  return board->columns * board->rows / 2 > 250 ? "there are only 250 different markers" : "";
}

}  // namespace

tl::expected<Board, std::string> parse_board(const std::string& text) {
  const auto fail = [&](const std::string& problem) {
    return tl::make_unexpected(fmt::format("'{}': {}", text, problem));
  };
  const auto parts = split(text, ':');
  const std::string kind = parts.empty() ? "" : parts[0];
  if (kind == "aprilgrid") {
    return fail(
        "OpenCV 4.6 finds AprilTags, but no AprilGrid, whose tags touch at their corners; "
        "print charuco:...:apriltag instead");
  }
  const bool charuco = kind == "charuco";
  if (!charuco && kind != "chessboard") return fail("the board is neither chessboard nor charuco");
  if (charuco ? parts.size() != 4 && parts.size() != 5 : parts.size() != 3) {
    return fail(charuco ? "the form is charuco:8x6:0.03:0.022[:4x4]: squares, sides of square and marker [m]"
                        : "the form is chessboard:9x6:0.025: inner corners, side of a square [m]");
  }
  Board board;
  board.kind = charuco ? BoardKind::kCharuco : BoardKind::kChessboard;
  std::string wrong = read_counts(parts[1], &board);
  if (wrong.empty()) wrong = read_square(parts[2], &board);
  if (wrong.empty() && charuco) wrong = read_markers(parts, &board);
  if (!wrong.empty()) return fail(wrong);
  return board;
}

std::optional<BoardView> find_board(const cv::Mat& image, const Board& board) {
  return board.kind == BoardKind::kCharuco ? find_charuco(image, board) : find_chessboard(image, board);
}

void same_order(const Board& board, const BoardView& left, BoardView* right) {
  if (board.kind != BoardKind::kChessboard) return;
  const cv::Point2f along_left = left.pixels.back() - left.pixels.front();
  const cv::Point2f along_right = right->pixels.back() - right->pixels.front();
  if (along_left.dot(along_right) < 0) std::reverse(right->pixels.begin(), right->pixels.end());
}

}  // namespace twofold
