#include "surface/volume.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <memory>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "surface/meshing.hpp"
#include "surface/packed_images.hpp"
#include "tests/surface/ball_views.hpp"

namespace twofold {
namespace {

using testing::Ball;
using testing::camera_around;
using testing::depth_of;
using testing::depth_rig;
using testing::fine_options;

bool is_free(const SurfaceVolume& volume, const Vector3& x_v) {
  const auto found = volume.distance(x_v);
  return found && found->distance > 0;
}

bool is_occupied(const SurfaceVolume& volume, const Vector3& x_v) {
  const auto found = volume.distance(x_v);
  return found && found->distance <= 0;
}

TEST(SurfaceVolume, KnowsFreeOccupiedAndUnknown) {
  const Ball ball;
  const SurfaceVolume volume = testing::volume_of(ball);
  EXPECT_TRUE(is_free(volume, {0.165, 0, 0}));
  EXPECT_TRUE(is_occupied(volume, {0.14, 0, 0}));
  EXPECT_FALSE(volume.distance({0, 0, 0}));  // deeper than the truncation
  EXPECT_FALSE(volume.distance({3, 0, 0}));
}

TEST(SurfaceVolume, DistanceAndGradientAreThoseOfTheSurface) {
  const Ball ball;
  const SurfaceVolume volume = testing::volume_of(ball);
  for (const double angle : {0.1, 1.3, 2.9, 4.4}) {
    const Vector3 out(std::cos(angle), std::sin(angle), 0.2);
    const Vector3 x = (ball.radius + 0.004) * out.normalized();
    const auto found = volume.distance(x);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->distance, 0.004, 0.002);
    EXPECT_GT(found->gradient.normalized().dot(out.normalized()), 0.95);
    const double step = 1e-4;
    const auto beside = volume.distance(x + Vector3(step, 0, 0));
    ASSERT_TRUE(beside);
    EXPECT_NEAR((beside->distance - found->distance) / step, found->gradient.x(), 0.05);
  }
}

TEST(SurfaceVolume, WhatWentAwayIsCarvedAway) {
  const Rig rig = depth_rig();
  const Ball ball{{0, 0, 0}, 0.1};
  SurfaceVolume volume(fine_options());
  const SE3 T_c_w = camera_around(0, 1);
  for (int n = 0; n < 12; ++n) volume.fuse(make_depth_view(rig, depth_of(rig, T_c_w, ball, 1.5), {}), T_c_w);
  const Vector3 inside = T_c_w.inverse() * Vector3(0, 0, 0.8 - 0.1 + 0.005);
  ASSERT_TRUE(is_occupied(volume, inside));
  const Ball away{{50, 0, 0}, 0.1};
  for (int n = 0; n < 12; ++n) volume.fuse(make_depth_view(rig, depth_of(rig, T_c_w, away, 1.5), {}), T_c_w);
  EXPECT_TRUE(is_free(volume, inside));
  // Nothing of the ball is left, only the wall behind it.
  for (const Eigen::Vector3f& x : extract_mesh(volume).positions)
    EXPECT_GT((T_c_w * Vector3(x.cast<double>())).z(), 1.4);
}

/// However often it was seen before; and one image that is wrong takes nothing away.
TEST(SurfaceVolume, FourSightsCarveAwayWhatStoodForLong) {
  const Rig rig = depth_rig();
  const Ball ball{{0, 0, 0}, 0.1}, away{{50, 0, 0}, 0.1};
  SurfaceVolume volume(fine_options());
  const SE3 T_c_w = camera_around(0, 1);
  for (int n = 0; n < 60; ++n) volume.fuse(make_depth_view(rig, depth_of(rig, T_c_w, ball, 1.5), {}), T_c_w);
  const auto vertices_of_ball = [&] {
    std::size_t count = 0;
    for (const Eigen::Vector3f& x : extract_mesh(volume).positions)
      count += (T_c_w * Vector3(x.cast<double>())).z() < 1.4 ? 1 : 0;
    return count;
  };
  const std::size_t before = vertices_of_ball();
  ASSERT_GT(before, 500U);
  volume.fuse(make_depth_view(rig, depth_of(rig, T_c_w, away, 1.5), {}), T_c_w);
  EXPECT_GT(vertices_of_ball(), before * 9 / 10);
  for (int n = 0; n < 3; ++n) volume.fuse(make_depth_view(rig, depth_of(rig, T_c_w, away, 1.5), {}), T_c_w);
  EXPECT_EQ(vertices_of_ball(), 0U);
}

TEST(SurfaceVolume, NoiseIsAveragedOut) {
  const Rig rig = depth_rig();
  const SE3 T_c_w;
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0, 0.006f);
  SurfaceVolume volume(fine_options());
  double one = 0, many = 0;
  const auto error = [&] {
    double sum = 0;
    const TriangleMesh mesh = extract_mesh(volume);
    for (const auto& x : mesh.positions) sum += std::abs(x.z() - 1.5f);
    return sum / static_cast<double>(mesh.positions.size());
  };
  for (int n = 0; n < 30; ++n) {
    cv::Mat depth(rig.camera.height, rig.camera.width, CV_32FC1);
    for (int i = 0; i < static_cast<int>(depth.total()); ++i) depth.at<float>(i) = 1.5f + noise(random);
    volume.fuse(make_depth_view(rig, depth, {}), T_c_w);
    if (n == 0) one = error();
  }
  many = error();
  EXPECT_LT(many, 0.35 * one);
  EXPECT_LT(many, 0.0015);
}

/// Tiles, groups of pixels and rows of samples end elsewhere than such an image.
TEST(SurfaceVolume, ImagesOfOddSizesAreSeenToTheirRims) {
  Rig rig = depth_rig(323, 241);
  SurfaceVolume volume(fine_options());
  const cv::Mat depth(rig.camera.height, rig.camera.width, CV_32FC1, cv::Scalar(1.5));
  for (int n = 0; n < 3; ++n) volume.fuse(make_depth_view(rig, depth, {}), SE3());
  for (const Vector2& uv : {Vector2(3, 3), Vector2(319, 3), Vector2(3, 237), Vector2(319, 237)}) {
    const Vector3 ray = rig.camera.unproject(uv);
    const auto before = volume.distance(ray * 1.47);
    ASSERT_TRUE(before) << uv.transpose();
    EXPECT_NEAR(before->distance, 0.03, 0.002) << uv.transpose();
    EXPECT_TRUE(is_occupied(volume, ray * 1.52)) << uv.transpose();
    EXPECT_FALSE(volume.distance(ray * 1.7)) << uv.transpose();
  }
}

/// Whole numbers hold what far readings, which weigh next to nothing, say.
TEST(SurfaceVolume, FarReadingsCountToo) {
  Rig rig = depth_rig();
  SurfaceOptions options = fine_options(0.005);
  options.depth_noise = 0.01;
  SurfaceVolume volume(options);
  const cv::Mat depth(rig.camera.height, rig.camera.width, CV_32FC1, cv::Scalar(7));
  volume.fuse(make_depth_view(rig, depth, {}), SE3());
  const auto behind = volume.distance({0.01, 0.01, 7.05});
  const auto before = volume.distance({0.01, 0.01, 6.9});
  ASSERT_TRUE(before && behind);
  EXPECT_NEAR(behind->distance, -0.05, 0.005);
  EXPECT_NEAR(before->distance, 0.1, 0.005);
}

TEST(SurfaceVolume, AddedVolumesKeepTheirShape) {
  const Ball ball{{0.02, 0.01, 0}, 0.15};
  const SurfaceVolume part = testing::volume_of(ball);
  const SE3 T_v_o(SO3::exp(Vector3(0.3, -0.2, 0.4)), Vector3(1.003, 0.207, -0.4));
  SurfaceVolume whole(part.options());
  whole.add(part, T_v_o);
  const TriangleMesh mesh = extract_mesh(whole);
  ASSERT_GT(mesh.positions.size(), 1000u);
  double sum = 0;
  for (const auto& x : mesh.positions)
    sum += std::abs((x.cast<double>() - T_v_o * ball.centre).norm() - ball.radius);
  EXPECT_LT(sum / static_cast<double>(mesh.positions.size()), 0.002);
}

TEST(SurfaceVolume, ColoursComeFromTheImage) {
  const Rig rig = depth_rig();
  const SE3 T_c_w;
  const cv::Mat depth(rig.camera.height, rig.camera.width, CV_32FC1, cv::Scalar(1.0));
  const cv::Mat blue_green_red(depth.size(), CV_8UC3, cv::Scalar(10, 120, 250));
  SurfaceVolume volume(fine_options());
  for (int n = 0; n < 3; ++n) volume.fuse(make_depth_view(rig, depth, blue_green_red), T_c_w);
  const TriangleMesh mesh = extract_mesh(volume);
  ASSERT_FALSE(mesh.colours.empty());
  for (const auto& c : mesh.colours) {
    EXPECT_NEAR(c[0], 250, 1);
    EXPECT_NEAR(c[1], 120, 1);
    EXPECT_NEAR(c[2], 10, 1);
  }
}

TEST(DepthView, SaysWhatIsWrong) {
  const Rig rig = depth_rig();
  EXPECT_NE(depth_defect(rig, {}, {}).find("no depth"), std::string::npos);
  EXPECT_NE(depth_defect(rig, cv::Mat(240, 320, CV_8UC1), {}).find("16 bits"), std::string::npos);
  EXPECT_NE(depth_defect(rig, cv::Mat(120, 320, CV_16UC1), {}).find("320x120"), std::string::npos);
  EXPECT_NE(depth_defect(rig, cv::Mat(240, 320, CV_16UC1), cv::Mat(24, 32, CV_8UC3)).find("32x24"),
            std::string::npos);
  EXPECT_EQ(depth_defect(rig, cv::Mat(240, 320, CV_16UC1), {}), "");
}

TEST(DepthView, BadReadingsAreLeftOut) {
  const Rig rig = depth_rig();
  cv::Mat depth(rig.camera.height, rig.camera.width, CV_32FC1, cv::Scalar(1.0));
  depth.at<float>(5, 5) = std::numeric_limits<float>::quiet_NaN();
  depth.at<float>(15, 5) = std::numeric_limits<float>::infinity();
  depth.at<float>(25, 5) = -1;
  depth.at<float>(35, 5) = 0.01f;
  depth.colRange(200, 320).setTo(2.0);
  const DepthView view = make_depth_view(rig, depth, {});
  for (const int y : {5, 15, 25, 35}) EXPECT_EQ(view.depth.at<float>(y, 5), 0);
  EXPECT_EQ(view.depth.at<float>(5, 6), 1);
  EXPECT_EQ(view.depth.at<float>(100, 199), 0);  // beside the jump
  EXPECT_EQ(view.depth.at<float>(100, 200), 0);
  EXPECT_EQ(view.depth.at<float>(100, 202), 2);
  EXPECT_EQ(view.pixel(100, 200).nearest, 1);
  EXPECT_EQ(view.pixel(6, 6).nearest, 0);  // a hole beside it
}

TEST(DepthView, NothingButHolesLeavesTheVolumeEmpty) {
  const Rig rig = depth_rig();
  for (const double z : {0.0, 60.0, std::numeric_limits<double>::quiet_NaN()}) {
    SurfaceVolume volume(fine_options());
    volume.fuse(make_depth_view(rig, cv::Mat(240, 320, CV_32FC1, cv::Scalar(z)), {}), SE3());
    EXPECT_EQ(volume.blocks().size(), 0u);
    EXPECT_TRUE(extract_mesh(volume).triangles.empty());
  }
}

double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  double all = 0, resident = 0;
  statm >> all >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

/// What was free before has the colour of the surface that comes, not a mixture with none.
TEST(SurfaceVolume, TakesTheFirstColourWhole) {
  const Rig rig = depth_rig();
  SurfaceVolume volume(fine_options(0.02));
  const cv::Mat far(rig.camera.height, rig.camera.width, CV_32FC1, cv::Scalar(1.1));
  const cv::Mat near(rig.camera.height, rig.camera.width, CV_32FC1, cv::Scalar(1.0));
  const cv::Mat grey(rig.camera.height, rig.camera.width, CV_8UC1, cv::Scalar(200));
  for (const cv::Mat& depth : {far, near}) volume.fuse(make_depth_view(rig, depth, grey), SE3());
  int coloured = 0, without = 0;
  for (const VoxelBlock* block : volume.blocks().sorted()) {
    without += block->colour == nullptr;
    for (std::size_t s = 0; s < kBlockSamples; ++s) {
      const SampleColour colour = colour_of(*block, s);
      if (colour == 0) continue;
      ++coloured;
      ASSERT_EQ(colour & kColourMask, 200u * kColourSteps);
    }
  }
  EXPECT_GT(coloured, 10000);
  EXPECT_GT(without, 0);
}

/// Small things that others allocate meanwhile, and keep, must not hold what a volume gives back.
TEST(BlockTable, GivesMemoryBackToTheSystem) {
  constexpr int kBlocks = 24000;  // 100 MB with their colours
  BlockTable table;
  std::vector<std::unique_ptr<std::array<char, 2000>>> others;
  const double before = resident_mb();
  // The allocator learns from what is given back: only the second time does it take such memory from the
  // heap.
  for (int round = 0; round < 2; ++round) {
    for (int i = 0; i < kBlocks; ++i) {
      VoxelBlock& block = table[table.find_or_add({i, 0, 0})];
      // Pages are taken at once, but not by every kernel, nor by an emulator.
      block.weight.fill(1);
      table.colour_for(block).samples.fill(1);
      if (i % 16 == 0) others.push_back(std::make_unique<std::array<char, 2000>>());
    }
    const double full = resident_mb() - before;
    table.clear();
    const double empty = resident_mb() - before;
    std::printf("%.0f MB, %.0f MB when cleared\n", full, empty);
    EXPECT_GT(full, 90);
    EXPECT_LT(empty, 20);
  }
}

/// A submap has tables of its own: what each takes beyond its blocks counts as often.
TEST(BlockTable, TakesLittleMoreThanItsBlocks) {
  constexpr int kBlocks = 2000;
  BlockTable table;
  for (int i = 0; i < kBlocks; ++i) (void)table.colour_for(table[table.find_or_add({i, 0, 0})]);
  constexpr double kNeeded = kBlocks * (sizeof(VoxelBlock) + sizeof(BlockColour));
  EXPECT_GT(static_cast<double>(table.bytes()), kNeeded);
  EXPECT_LT(static_cast<double>(table.bytes()), 1.1 * kNeeded);
}

TEST(PackedColour, GivesBackAnImageOfAnyHeightWithoutSeams) {
  for (const int height : {1, 63, 64, 65, 480}) {
    cv::Mat image(height, 100, CV_8UC3);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < 100; ++x)
        image.at<cv::Vec3b>(y, x) =
            cv::Vec3b(static_cast<std::uint8_t>(2 * x), static_cast<std::uint8_t>(y / 2), 90);
    const PackedColour packed(image);
    EXPECT_FALSE(packed.empty());
    const cv::Mat unpacked = packed.unpacked();
    ASSERT_EQ(unpacked.size(), image.size());
    ASSERT_EQ(unpacked.type(), image.type());
    EXPECT_LE(cv::norm(unpacked, image, cv::NORM_INF), 4) << height;
    const PackedColour grey(image.reshape(1));
    EXPECT_EQ(grey.unpacked().type(), CV_8UC1);
  }
  EXPECT_TRUE(PackedColour().unpacked().empty());
}

TEST(PackedDepth, GivesBackWhatItWasGiven) {
  cv::Mat depth(48, 64, CV_16UC1);
  std::mt19937 random(3);
  for (int i = 0; i < static_cast<int>(depth.total()); ++i)
    depth.at<std::uint16_t>(i) =
        static_cast<std::uint16_t>(i % 7 == 0    ? 0
                                   : i % 97 == 0 ? 65535
                                                 : 1500 + static_cast<int>(random() % 9));
  const PackedDepth packed(depth);
  EXPECT_EQ(cv::norm(packed.unpacked(), depth, cv::NORM_INF), 0);
  EXPECT_LT(packed.bytes(), 2 * depth.total());
}

TEST(PackedDepth, KeepsAnyNumbersInRowsOfAnyLength) {
  std::mt19937 random(4);
  for (const int width : {1, 15, 16, 17, 37}) {
    cv::Mat depth(3, width, CV_16UC1);
    for (int i = 0; i < static_cast<int>(depth.total()); ++i)
      depth.at<std::uint16_t>(i) = static_cast<std::uint16_t>(random() >> (random() % 17));
    EXPECT_EQ(cv::norm(PackedDepth(depth).unpacked(), depth, cv::NORM_INF), 0) << width;
  }
}

TEST(DepthView, TakesTheMemoryOfTheImageBefore) {
  const Rig rig = depth_rig();
  const cv::Mat near(rig.camera.height, rig.camera.width, CV_32FC1, cv::Scalar(1.0));
  const cv::Mat far(rig.camera.height, rig.camera.width, CV_32FC1, cv::Scalar(2.0));
  DepthView view = make_depth_view(rig, near, {});
  const uchar* const before = view.pixels.data;
  prepare_depth_view(rig, far, {}, view);
  EXPECT_EQ(view.pixels.data, before);
  EXPECT_EQ(cv::norm(view.pixels, make_depth_view(rig, far, {}).pixels, cv::NORM_INF), 0);
}

}  // namespace
}  // namespace twofold
