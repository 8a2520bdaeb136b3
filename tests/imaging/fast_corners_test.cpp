#include "imaging/fast_corners.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <random>
#include <utility>
#include <vector>

#include "imaging/corner_selection.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {
namespace {

/// FAST-9 by its definition.
bool is_corner(const cv::Mat& image, int u, int v, int threshold) {
  constexpr std::array<std::array<int, 2>, 16> kCircle{{{0, -3},
                                                        {1, -3},
                                                        {2, -2},
                                                        {3, -1},
                                                        {3, 0},
                                                        {3, 1},
                                                        {2, 2},
                                                        {1, 3},
                                                        {0, 3},
                                                        {-1, 3},
                                                        {-2, 2},
                                                        {-3, 1},
                                                        {-3, 0},
                                                        {-3, -1},
                                                        {-2, -2},
                                                        {-1, -3}}};
  const int centre = image.at<std::uint8_t>(v, u);
  for (const int sign : {1, -1}) {
    int run = 0;
    for (std::size_t k = 0; k < 32; ++k) {
      const auto& at = kCircle[k % 16];
      const int difference = sign * (image.at<std::uint8_t>(v + at[1], u + at[0]) - centre);
      run = difference > threshold ? run + 1 : 0;
      if (run >= 9) return true;
    }
  }
  return false;
}

float score_by_definition(const cv::Mat& image, int u, int v) {
  double uu = 0, uv = 0, vv = 0;
  for (int y = v - 4; y < v + 4; ++y) {
    for (int x = u - 4; x < u + 4; ++x) {
      const double gu = 0.5 * (image.at<std::uint8_t>(y, x + 1) - image.at<std::uint8_t>(y, x - 1));
      const double gv = 0.5 * (image.at<std::uint8_t>(y + 1, x) - image.at<std::uint8_t>(y - 1, x));
      uu += gu * gu / 64, uv += gu * gv / 64, vv += gv * gv / 64;
    }
  }
  Eigen::Matrix2d tensor;
  tensor << uu, uv, uv, vv;
  return static_cast<float>(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(tensor).eigenvalues()(0));
}

/// Blurred blocks: corners of all strengths, extremes of grey included.
cv::Mat random_image(int width, int height) {
  std::mt19937 random(3);
  cv::Mat image(height, width, CV_8UC1);
  cv::Mat blocks(height / 6 + 1, width / 6 + 1, CV_8UC1);
  for (int i = 0; i < blocks.rows * blocks.cols; ++i) {
    blocks.data[i] = static_cast<std::uint8_t>(std::array{0, 30, 120, 128, 135, 250, 255}[random() % 7]);
  }
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const int noisy = blocks.at<std::uint8_t>(v / 6, u / 6) + static_cast<int>(random() % 7) - 3;
      image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(std::clamp(noisy, 0, 255));
    }
  }
  return image;
}

CellGrid grid_over(const cv::Mat& image, int cell, std::vector<std::uint8_t>& occupied) {
  CellGrid grid{cell, image.cols / cell + 1, image.rows / cell + 1, {}};
  occupied.assign(static_cast<std::size_t>(grid.columns * grid.rows), 0);
  grid.occupied = occupied;
  return grid;
}

TEST(FastCorners, AreThoseOfTheDefinition) {
  // Cells of four pixels and a low score let nearly every corner through; widths that no run divides.
  for (const int width : {101, 133, 160}) {
    const cv::Mat image = random_image(width, 60);
    std::vector<std::uint8_t> occupied;
    const CellGrid grid = grid_over(image, 4, occupied);
    for (const int threshold : {8, 25, 60}) {
      std::vector<Corner> corners;
      corners.reserve(10000);
      detect_corners(image, 0, threshold, 0, 8, grid, corners);
      std::size_t cells_with_corner = 0;
      for (int row = 0; row < grid.rows; ++row) {
        for (int column = 0; column < grid.columns; ++column) {
          bool any = false;
          for (int v = std::max(8, row * 4); v < std::min(image.rows - 8, row * 4 + 4); ++v) {
            for (int u = std::max(8, column * 4); u < std::min(image.cols - 8, column * 4 + 4); ++u) {
              any |= is_corner(image, u, v, threshold) && score_by_definition(image, u, v) > 1e-3;
            }
          }
          cells_with_corner += any;
        }
      }
      ASSERT_GT(cells_with_corner, 20u);
      EXPECT_EQ(corners.size(), cells_with_corner) << width << " " << threshold;
      for (const Corner& corner : corners) {
        ASSERT_TRUE(is_corner(image, corner.u, corner.v, threshold)) << corner.u << " " << corner.v;
        ASSERT_NEAR(corner.score, score_by_definition(image, corner.u, corner.v), 1e-2 + 1e-4 * corner.score);
      }
    }
  }
}

/// Images of telephones, panoramas: what stands out weakly in a row of cells is then found twice, not kept.
TEST(FastCorners, AreTheSameInAnImageOfAnyWidth) {
  constexpr int kCell = 168, kColumns = 5;
  const cv::Mat wide = random_image(7000, 400);
  const cv::Mat narrow = wide.colRange(0, (kColumns + 1) * kCell).clone();
  std::vector<Corner> of_wide, of_narrow;
  for (const auto& [image, corners] : {std::pair(&wide, &of_wide), std::pair(&narrow, &of_narrow)}) {
    std::vector<std::uint8_t> occupied;
    const CellGrid grid = grid_over(*image, kCell, occupied);
    corners->reserve(1000);
    detect_corners(*image, 0, 10, 20, 8, grid, *corners);
    std::erase_if(*corners, [](const Corner& corner) { return corner.u >= kColumns * kCell; });
  }
  ASSERT_EQ(of_narrow.size(), 3U * kColumns);
  ASSERT_EQ(of_wide.size(), of_narrow.size());
  for (std::size_t i = 0; i < of_wide.size(); ++i) {
    EXPECT_EQ(of_wide[i].u, of_narrow[i].u);
    EXPECT_EQ(of_wide[i].v, of_narrow[i].v);
    EXPECT_EQ(of_wide[i].score, of_narrow[i].score);
  }
}

TEST(FastCorners, GridsHaveRoomForTheWidestImage) {
  for (const int width : {32, 640, 3840, 4096, 7168, 12000, 16384}) {
    const int cell = CellGrid::smallest_cell_px(width);
    EXPECT_LE(width / cell + 1, CellGrid::kMaxColumns) << width;
    EXPECT_EQ(cell % 4, 0);
  }
}

TEST(CornerSelector, TakesImagesOfAnyShape) {
  for (const auto& [width, height] : {std::pair(3840, 2160), std::pair(16384, 96), std::pair(128, 4000)}) {
    ImagePyramid pyramid;
    pyramid.build(random_image(width, height));
    CornerSelector selector({.wanted = 700});
    std::vector<DescribedCorner> corners;
    selector.select(pyramid, corners);
    EXPECT_GT(corners.size(), 300U) << width << "x" << height;
    EXPECT_LE(corners.size(), 700U) << width << "x" << height;
  }
}

TEST(FastCorners, LeaveOccupiedCellsAndWeakOnesOut) {
  const cv::Mat image = random_image(160, 120);
  std::vector<std::uint8_t> occupied;
  CellGrid grid = grid_over(image, 16, occupied);
  std::vector<Corner> all, some;
  all.reserve(1000);
  some.reserve(1000);
  detect_corners(image, 0, 10, 20, 8, grid, all);
  for (const Corner& corner : all) EXPECT_GE(corner.score, 20);
  for (std::size_t i = 0; i < occupied.size(); i += 2) occupied[i] = 1;
  grid.occupied = occupied;
  detect_corners(image, 0, 10, 20, 8, grid, some);
  ASSERT_FALSE(some.empty());
  EXPECT_LT(some.size(), all.size());
  for (const Corner& corner : some) {
    EXPECT_EQ(occupied[static_cast<std::size_t>(corner.v / 16 * grid.columns + corner.u / 16)], 0);
  }
}

TEST(FastCorners, NeverGrowTheList) {
  const cv::Mat image = random_image(160, 120);
  std::vector<std::uint8_t> occupied;
  const CellGrid grid = grid_over(image, 8, occupied);
  std::vector<Corner> corners;
  corners.reserve(5);
  detect_corners(image, 0, 10, 0, 8, grid, corners);
  EXPECT_EQ(corners.size(), 5u);
  EXPECT_EQ(corners.capacity(), 5u);
}

}  // namespace
}  // namespace twofold
