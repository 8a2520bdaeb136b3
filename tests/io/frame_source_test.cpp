#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "io/sources/open_source.hpp"
#include "io/sources/recorded_images.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 64, kHeight = 48, kCount = 5;

void write_kitti(const ScratchFolder& folder) {
  std::string times, poses;
  for (int i = 0; i < kCount; ++i) {
    folder.write_image(fmt::format("image_0/{:06d}.png", i), numbered_image(kWidth, kHeight, i));
    folder.write_image(fmt::format("image_1/{:06d}.png", i), numbered_image(kWidth, kHeight, 100 + i));
    times += fmt::format("{:e}\n", 0.1 * i);
    poses += fmt::format("1 0 0 0 0 1 0 0 0 0 1 {}\n", i);
  }
  folder.write("times.txt", times);
  folder.write("poses.txt", poses);
  folder.write("calib.txt", "P0: 50 0 32 0 0 50 24 0 0 0 1 0\nP1: 50 0 32 -10 0 50 24 0 0 0 1 0\n");
}

void write_tum(const ScratchFolder& folder) {
  std::string rgb, depth;
  for (int i = 0; i < kCount; ++i) {
    folder.write_image(fmt::format("rgb/{}.png", i), numbered_image(kWidth, kHeight, i, CV_8UC3));
    folder.write_image(fmt::format("depth/{}.png", i),
                       cv::Mat(kHeight, kWidth, CV_16UC1, cv::Scalar(1000 + i)));
    rgb += fmt::format("{:.3f} rgb/{}.png\n", 10 + 0.1 * i, i);
    // The third depth image is too late for its colour image.
    depth += fmt::format("{:.3f} depth/{}.png\n", 10 + 0.1 * i + (i == 2 ? 0.03 : 0.01), i);
  }
  folder.write("rgb.txt", "# time file\n" + rgb);
  folder.write("depth.txt", depth);
  folder.write("groundtruth.txt", "10.0 0 0 0 0 0 0 1\n10.1 1 0 0 0 0 0 1\n");
}

/// What a source ends with: its error, or how many frames it gave.
std::string drain(FrameSource& source) {
  Frame frame;
  int count = 0;
  while (true) {
    switch (source.next(frame)) {
      case FrameStatus::kFrame:
        ++count;
        break;
      case FrameStatus::kEnd:
        return std::to_string(count);
      case FrameStatus::kError:
        return source.error();
    }
  }
}

/// The next frames of what write_kitti wrote.
void expect_frames(FrameSource& source, int first, int last) {
  Frame frame;
  for (int i = first; i <= last; ++i) {
    ASSERT_EQ(source.next(frame), FrameStatus::kFrame) << source.error();
    EXPECT_EQ(frame.index, i);
    EXPECT_EQ(frame.t_ns, i * 100'000'000LL);
    EXPECT_EQ(frame.left.at<unsigned char>(0, 5), i);
    EXPECT_EQ(frame.right.at<unsigned char>(0, 5), 100 + i);
  }
}

TEST(FrameSource, KittiStereo) {
  const ScratchFolder folder;
  write_kitti(folder);
  const auto source = open_source(folder.path().string());
  EXPECT_EQ(source->rig().kind, SensorKind::kStereo);
  EXPECT_NEAR(source->rig().baseline, 0.2, 1e-12);
  EXPECT_EQ(source->rig().camera.width, kWidth);
  EXPECT_EQ(source->frame_count(), kCount);
  ASSERT_EQ(source->ground_truth().size(), std::size_t{kCount});
  EXPECT_EQ(source->ground_truth()[3].t_ns, 300'000'000);
  EXPECT_EQ(source->ground_truth()[3].T_w_c.translation().z(), 3);
  expect_frames(*source, 0, kCount - 1);
  Frame frame;
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
}

std::vector<std::int64_t> frame_numbers_of(FrameSource& source) {
  std::vector<std::int64_t> numbers;
  for (Frame frame; source.next(frame) == FrameStatus::kFrame;) numbers.push_back(frame.index);
  return numbers;
}

TEST(FrameSource, APartOfARecordingKeepsNumbersAndTimes) {
  const ScratchFolder folder;
  write_kitti(folder);
  const auto source = open_source(folder.path().string() + "?first=1&frames=3");
  EXPECT_EQ(source->frame_count(), 3);
  EXPECT_EQ(source->ground_truth().size(), std::size_t{kCount}) << "is of the whole";
  expect_frames(*source, 1, 3);
  Frame frame;
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
  using Numbers = std::vector<std::int64_t>;
  EXPECT_EQ(frame_numbers_of(*open_source(folder.path().string() + "?first=3")), (Numbers{3, 4}));
  EXPECT_EQ(frame_numbers_of(*open_source(folder.path().string() + "?frames=2")), (Numbers{0, 1}));
  EXPECT_EQ(frame_numbers_of(*open_source(folder.path().string() + "?first=4&frames=1000")), (Numbers{4}));
  folder.write("image_0/000000.png", "broken");
  EXPECT_EQ(frame_numbers_of(*open_source(folder.path().string() + "?first=1")), (Numbers{1, 2, 3, 4}))
      << "what comes before is not read";
}

TEST(FrameSource, PartsThatNoRecordingHasAreRefused) {
  const ScratchFolder folder;
  write_kitti(folder);
  const std::string path = folder.path().string();
  EXPECT_IO_ERROR(open_source(path + "?first=5"), "first=5: the recording has 5 frames, which count from 0");
  EXPECT_IO_ERROR(open_source(path + "?first=-1"), "parameter first='-1' is not a whole number from 0 on");
  EXPECT_IO_ERROR(open_source(path + "?first=1.5"), "parameter first='1.5' is not a whole number");
  EXPECT_IO_ERROR(open_source(path + "?frames=0"), "parameter frames='0' is not a whole number from 1 on");
  EXPECT_IO_ERROR(open_source(path + "?frames=all"), "parameter frames='all' is not a whole number");
  EXPECT_IO_ERROR(open_source("synthetic:desk?first=3"), "first");
}

TEST(FrameSource, EarlierFramesSurviveLaterOnes) {
  const ScratchFolder folder;
  write_kitti(folder);
  const auto source = open_source(folder.path().string());
  Frame frame;
  ASSERT_EQ(source->next(frame), FrameStatus::kFrame);
  const cv::Mat held = frame.left;
  ASSERT_EQ(source->next(frame), FrameStatus::kFrame);
  EXPECT_EQ(held.at<unsigned char>(0, 5), 0);
}

TEST(FrameSource, PreloadGivesTheSameFrames) {
  const ScratchFolder folder;
  write_kitti(folder);
  const auto direct = open_source(folder.path().string());
  const auto preloaded = open_source(folder.path().string(), {.calibration = {}, .preload = true});
  EXPECT_EQ(preloaded->frame_count(), kCount);
  EXPECT_EQ(preloaded->ground_truth().size(), direct->ground_truth().size());
  Frame a, b;
  while (direct->next(a) == FrameStatus::kFrame) {
    ASSERT_EQ(preloaded->next(b), FrameStatus::kFrame);
    EXPECT_EQ(a.t_ns, b.t_ns);
    EXPECT_EQ(a.index, b.index);
    EXPECT_EQ(cv::norm(a.left, b.left, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(a.right, b.right, cv::NORM_INF), 0);
  }
  EXPECT_EQ(preloaded->next(b), FrameStatus::kEnd);
}

TEST(FrameSource, KittiBrokenInput) {
  const ScratchFolder folder;
  const auto error_after = [&](auto&& damage) {
    write_kitti(folder);
    damage();
    try {
      return drain(*open_source(folder.path().string()));
    } catch (const IoError& e) {
      return std::string(e.what());
    }
  };
  const auto expect = [](const std::string& message, const std::string& part) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
  };
  expect(error_after([] {}), "5");
  expect(error_after([&] {
           for (int i = 0; i < 5; ++i) folder.write(fmt::format("image_1/00000{}.png", i), "broken");
         }),
         "000004.png: the image cannot be decoded");
  expect(error_after([&] { folder.write_image("image_1/000002.png", numbered_image(60, 48, 1)); }),
         fmt::format("000002.png: the image is 60x48, the first image ({}) is 64x48",
                     folder / "image_0/000000.png"));
  expect(error_after([&] { folder.write("times.txt", "0\n1\n1\n2\n3\n"); }), "times.txt:3: time stamp");
  expect(error_after([&] { folder.write("times.txt", "0\n1\n2\n3\n2.5\n"); }), "times.txt:5: time stamp");
  expect(error_after([&] { folder.write("times.txt", "0\n1\n"); }), "has 2 time stamps for 5 images");
  expect(error_after([&] { folder.write("calib.txt", "P0: 50 0 32 0 0 50 24 0 0 0 1 0\n"); }),
         "key 'P1' is missing");
  expect(error_after([&] {
           folder.write("calib.txt", "P0: -50 0 32 0 0 50 24 0 0 0 1 0\nP1: -50 0 32 10 0 50 24 0 0 0 1 0\n");
         }),
         "calib.txt: left camera");
  expect(error_after([&] { fs::remove(folder.path() / "times.txt"); }), "times.txt: no such file");
  EXPECT_EQ(error_after([&] { fs::remove(folder.path() / "image_1/000004.png"); }), "4");
  expect(error_after([&] { fs::remove(folder.path() / "calib.txt"); }),
         "calib.txt: no such calibration file");
}

TEST(FrameSource, ADamagedImageIsAGap) {
  const ScratchFolder folder;
  write_kitti(folder);
  folder.write("image_0/000000.png", "broken");
  fs::remove(folder / "image_1/000003.png");
  fs::create_symlink(folder / "not there", folder / "image_1/000003.png");
  const auto source = open_source(folder.path().string());
  Frame frame;
  for (const int index : {1, 2, 4}) {
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.index, index);
  }
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
  const SourceReport report = source->report();
  EXPECT_EQ(report.lost, 2U);
  ASSERT_EQ(report.faults.size(), 2U);
  EXPECT_NE(report.faults[0].find("000000.png: the image cannot be decoded; its frame is left out"),
            std::string::npos)
      << report.faults[0];
  EXPECT_NE(report.faults[1].find("000003.png: "), std::string::npos) << report.faults[1];
  ASSERT_EQ(report.summary.size(), 2U);
  EXPECT_TRUE(report.summary[0].ends_with(": left out: 1 frame with a missing image")) << report.summary[0];
  EXPECT_TRUE(report.summary[1].ends_with(": left out: 1 frame with a damaged image")) << report.summary[1];
}

TEST(FrameSource, AMissingDepthImageIsAGapAndAMissingFolderIsNone) {
  const ScratchFolder folder;
  write_tum(folder);
  const std::string source = "tum:" + folder.path().string() + "?fx=50&fy=50&cx=32&cy=24";
  fs::remove(folder.path() / "depth/3.png");
  const auto with_gap = open_source(source);
  EXPECT_EQ(drain(*with_gap), "3");
  ASSERT_EQ(with_gap->report().summary.size(), 1U);
  EXPECT_TRUE(with_gap->report().summary[0].ends_with(": left out: 1 frame with a missing image"))
      << with_gap->report().summary[0];
  fs::remove_all(folder.path() / "depth");
  const auto without_depth = open_source(source);
  EXPECT_EQ(drain(*without_depth),
            (folder / "depth") + ": the folder is not there (--camera mono runs the left camera alone)");
  EXPECT_TRUE(without_depth->report().summary.empty());
}

TEST(FrameSource, AFrameThatWasPeekedAtComesNext) {
  const ScratchFolder folder;
  write_kitti(folder);
  const auto source = open_source(folder.path().string());
  const Frame* const first = source->peek();
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(first->index, 0);
  EXPECT_EQ(source->peek(), first);
  expect_frames(*source, 0, kCount - 1);
  EXPECT_EQ(source->peek(), nullptr);
  Frame frame;
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
  folder.write_image("image_1/000000.png", numbered_image(60, 48, 1));
  EXPECT_IO_ERROR(open_source(folder.path().string())->peek(), "image_1/000000.png: the image is 60x48");
}

TEST(FrameSource, WhatSaidAnotherSizeIsNamed) {
  const ScratchFolder folder;
  write_kitti(folder);
  const std::string file = folder.write("small.yaml",
                                        "sensor: stereo\nbaseline: 0.2\ncameras:\n"
                                        "  - {size: [64, 48], intrinsics: [50, 50, 32, 24]}\n");
  folder.write_image("image_1/000003.png", numbered_image(60, 48, 1));
  EXPECT_NE(drain(*open_source(folder.path().string(), {.calibration = file}))
                .find("000003.png: the image is 60x48, the calibration (" + file + ") is for 64x48"),
            std::string::npos);
}

/// As where a download ended, or a disk is gone.
TEST(FrameSource, ManyDamagedImagesInARowEndARecording) {
  const ScratchFolder folder;
  folder.write("mono.yaml", "sensor: mono\ncameras:\n  - {size: [64, 48], intrinsics: [50, 50, 32, 24]}\n");
  for (int i = 0; i < 30; ++i) {
    const std::string name = fmt::format("left/{:02}.png", i);
    if (i < 3 || (i >= 8 && i < 12))
      folder.write_image(name, numbered_image(kWidth, kHeight, i));
    else
      folder.write(name, "broken");
  }
  const auto source =
      open_source("images:" + folder.path().string() + "?fps=10", {.calibration = folder / "mono.yaml"});
  Frame frame;
  for (int i = 0; i < 7; ++i) ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
  EXPECT_EQ(source->next(frame), FrameStatus::kError);
  EXPECT_NE(source->error().find("22.png: "), std::string::npos) << source->error();
}

TEST(FrameSource, ATruthThatCannotBeReadIsLeftOut) {
  const ScratchFolder kitti, tum;
  write_kitti(kitti);
  kitti.write("poses.txt", "1 0 0 0 0 1 0 nan 0 0 1 0\n");
  write_tum(tum);
  tum.write("groundtruth.txt", "10.0 0 0 0 0 0 0 1\n10.1 nan 0 0 0 0 0 1\n");
  for (const auto& [text, line, frames] :
       {std::tuple{kitti.path().string(), "poses.txt:1: 'nan'", "5"},
        {"tum:" + tum.path().string() + "?fx=50&fy=50&cx=32&cy=24", "groundtruth.txt:2: 'nan'", "4"}}) {
    const auto source = open_source(text);
    EXPECT_TRUE(source->ground_truth().empty());
    ASSERT_EQ(source->report().notes.size(), 1U) << text;
    EXPECT_NE(source->report().notes[0].find(line), std::string::npos) << source->report().notes[0];
    EXPECT_NE(source->report().notes[0].find("the ground truth is left out"), std::string::npos);
    EXPECT_EQ(drain(*source), frames);
  }
}

TEST(FrameSource, TumAssociatesAndScales) {
  const ScratchFolder folder;
  write_tum(folder);
  const std::string intrinsics = "?fx=50&fy=50&cx=32&cy=24";
  EXPECT_IO_ERROR(open_source(folder.path().string()), "no calibration");
  EXPECT_IO_ERROR(open_source("tum:" + folder.path().string() + intrinsics + "&fz=1"),
                  "unknown parameter 'fz'");
  EXPECT_IO_ERROR(open_source("tum:" + folder.path().string() + intrinsics + "&depth_scale=0"),
                  "must be positive");
  EXPECT_IO_ERROR(open_source("tum:" + folder.path().string() + "?fx=-50&fy=50&cx=32&cy=24"), "left camera");
  folder.write("camera.txt", "fx 40\nfy 40\ncx 32\ncy 24\nwidth 64\nheight 48\n");
  EXPECT_IO_ERROR(open_source("tum:" + folder.path().string() + "?fx=50"), "all of fx, fy, cx, cy, or none");
  EXPECT_EQ(open_source("tum:" + folder.path().string() + intrinsics)->rig().camera.fx, 50);
  fs::remove(folder.path() / "camera.txt");
  const auto source = open_source("tum:" + folder.path().string() + intrinsics + "&depth_scale=1000");
  EXPECT_EQ(source->rig().kind, SensorKind::kRgbd);
  EXPECT_EQ(source->rig().depth_unit, 0.001);
  EXPECT_GT(source->rig().baseline, 0);
  EXPECT_EQ(source->frame_count(), kCount - 1);
  EXPECT_EQ(source->ground_truth().size(), 2u);
  Frame frame;
  for (const int i : {0, 1, 3, 4}) {
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.depth.at<std::uint16_t>(7, 7), 1000 + i);
    EXPECT_EQ(frame.left.at<unsigned char>(0, 5), i);
  }
}

/// Lenses are known from files that say nothing of depth; the unit is the folder's or the benchmark's then.
TEST(FrameSource, TumDepthUnitWhereTheCalibrationDoesNotSayIt) {
  const ScratchFolder folder;
  write_tum(folder);
  const std::string camera = "sensor: rgbd\ncameras:\n  - {size: [64, 48], intrinsics: [50, 50, 32, 24]}\n";
  const auto given = folder.write("given/lens.yaml", camera);
  const auto unit_of = [&](const std::string& parameters, const std::optional<fs::path>& calibration) {
    return open_source("tum:" + folder.path().string() + parameters, {.calibration = calibration})
        ->rig()
        .depth_unit;
  };
  EXPECT_EQ(unit_of("", given), 1.0 / 5000);
  const auto ros = folder.write(
      "given/ros.yaml",
      "image_width: 64\nimage_height: 48\ncamera_matrix: {data: [50, 0, 32, 0, 50, 24, 0, 0, 1]}\n");
  EXPECT_EQ(unit_of("", ros), 1.0 / 5000);
  EXPECT_EQ(unit_of("?depth_scale=500", given), 1.0 / 500);
  folder.write("camera.txt", "fx 40\nfy 40\ncx 32\ncy 24\ndepth_scale 2000\n");
  EXPECT_EQ(unit_of("", given), 1.0 / 2000);
  folder.write("calibration.yaml", camera);
  EXPECT_EQ(unit_of("", {}), 1.0 / 2000);
  folder.write("calibration.yaml", camera + "depth: {unit: 0.002}\n");
  EXPECT_EQ(unit_of("", {}), 0.002);
  EXPECT_EQ(unit_of("", given), 0.002);
  EXPECT_EQ(unit_of("", folder.write("given/lens.yaml", camera + "depth: {unit: 0.001}\n")), 0.001);
}

TEST(FrameSource, ImageFolderAndItsTimes) {
  const ScratchFolder folder;
  for (int i = 0; i < 3; ++i)
    folder.write_image(fmt::format("{}.png", i), numbered_image(kWidth, kHeight, i));
  const std::string spec = "images:" + folder.path().string() + "?fx=50&fy=50&cx=32&cy=24";
  EXPECT_IO_ERROR(open_source(spec), "times.txt");
  const auto source = open_source(spec + "&fps=10");
  EXPECT_EQ(source->rig().kind, SensorKind::kMono);
  EXPECT_EQ(drain(*source), "3");
}

/// What the frames of a source show: the number of each left image, and that of the other one.
std::vector<std::pair<int, int>> numbers_of(FrameSource& source) {
  std::vector<std::pair<int, int>> numbers;
  for (Frame frame; source.next(frame) == FrameStatus::kFrame;) {
    const int other = frame.depth.empty() ? frame.right.at<unsigned char>(0, 5)
                                          : static_cast<int>(frame.depth.at<std::uint16_t>(0, 5));
    numbers.emplace_back(frame.left.at<unsigned char>(0, 5), other);
  }
  return numbers;
}

using Numbers = std::vector<std::pair<int, int>>;

/// As many images on both sides, but not the same ones: positions would pair images of different times.
TEST(FrameSource, ImageFolderPairsByName) {
  for (const auto& [left, right] :
       {std::pair{"left/{}.png", "right/{}.png"}, {"left/l_{:03}.png", "right/r_{:03}.png"}}) {
    const ScratchFolder folder;
    for (int i = 0; i < 6; ++i) {
      if (i != 1) folder.write_image(fmt::format(fmt::runtime(left), i), numbered_image(kWidth, kHeight, i));
      if (i != 4)
        folder.write_image(fmt::format(fmt::runtime(right), i), numbered_image(kWidth, kHeight, 100 + i));
    }
    const std::string spec =
        "images:" + folder.path().string() + "?fx=50&fy=50&cx=32&cy=24&baseline=0.1&fps=10";
    EXPECT_IO_ERROR(open_source(spec), "right has no image of the same name or number (unpaired=drop");
    const auto source = open_source(spec + "&unpaired=drop", {.calibration = {}, .preload = true});
    EXPECT_EQ(numbers_of(*source), (Numbers{{0, 100}, {2, 102}, {3, 103}, {5, 105}}));
    EXPECT_EQ(source->report().lost, 2U);
    ASSERT_EQ(source->report().summary.size(), 1U);
    EXPECT_NE(source->report().summary[0].find("2 images without a partner"), std::string::npos);
    folder.write_image(fmt::format(fmt::runtime(left), 1), numbered_image(kWidth, kHeight, 1));
    fs::remove(folder / fmt::format(fmt::runtime(left), 4));
    EXPECT_IO_ERROR(open_source(spec + "&unpaired=keep"), "can only be 'drop'");
    EXPECT_EQ(numbers_of(*open_source(spec)), (Numbers{{0, 100}, {1, 101}, {2, 102}, {3, 103}, {5, 105}}));
    EXPECT_TRUE(open_source(spec)->report().summary.empty());
  }
}

TEST(FrameSource, ImageFolderPairsByPositionWhereNamesSayNothing) {
  const ScratchFolder folder;
  for (int i = 0; i < 3; ++i) {
    folder.write_image(fmt::format("left/0.{}0.png", i), numbered_image(kWidth, kHeight, i));
    folder.write_image(fmt::format("depth/0.{}1.png", i),
                       cv::Mat(kHeight, kWidth, CV_16UC1, cv::Scalar(1000 + i)));
  }
  const std::string spec = "images:" + folder.path().string() + "?fx=50&fy=50&cx=32&cy=24&fps=10";
  EXPECT_EQ(numbers_of(*open_source(spec)), (Numbers{{0, 1000}, {1, 1001}, {2, 1002}}));
  fs::remove(folder / "depth/0.21.png");
  EXPECT_IO_ERROR(open_source(spec), "left has 3 images, depth has 2");
}

TEST(FrameSource, ImageFolderTellsTimesFromNumbersAndNames) {
  const ScratchFolder folder;
  for (int i = 0; i < 3; ++i)
    folder.write_image(fmt::format("{:05}.png", 2 * i), numbered_image(kWidth, kHeight, i));
  const auto times = [&](const std::string& text) {
    folder.write("times.txt", text);
    const auto source = open_source("images:" + folder.path().string() + "?fx=50&fy=50&cx=32&cy=24");
    std::vector<std::int64_t> stamps;
    for (Frame frame; source->next(frame) == FrameStatus::kFrame;) stamps.push_back(frame.t_ns);
    return stamps;
  };
  const std::vector<std::int64_t> expected{10'000'000'000, 10'100'000'000, 10'200'000'000};
  EXPECT_EQ(times("10.0\n10.1\n10.2\n"), expected);
  EXPECT_EQ(times("00000 10.0 0.3\n00001 10.1 0.5\n00002 10.2 0.4\n"), expected) << "numbers from 0";
  EXPECT_EQ(times("1 10.0\n2 10.1\n3 10.2\n"), expected) << "from 1";
  EXPECT_EQ(times("00000 10.0 0.3\n00002 10.1 0.3\n00004 10.2 0.3\n"), expected) << "stems";
  EXPECT_EQ(times("00000.png 10.0\n00002.png 10.1\n00004.png 10.2\n"), expected) << "names";
  EXPECT_EQ(times("10.0 rgb/00000.png\n10.1 rgb/00002.png\n10.2 rgb/00004.png\n"), expected) << "a list";
  EXPECT_EQ(times("\xef\xbb\xbfimage time\r\n00000 10.0 \r\n00002 10.1\t\r\n00004 10.2\r\n"), expected)
      << "of Windows";
  EXPECT_EQ(times("10000000000000000\n10000000100000000\n10000000200000000\n").front(),
            10'000'000'000'000'000)
      << "nanoseconds, as ORB-SLAM3's lists of EuRoC's images";
  EXPECT_IO_ERROR(times("10.0 1 2 3\n10.1 1 2 3\n10.2 1 2 3\n"), "times.txt:1: is none of");
  EXPECT_IO_ERROR(times("0 10.0\n1 10.1\n3 10.2\n"), "times.txt:3: is none of");
  EXPECT_IO_ERROR(times("0 10.0\n1 10.1\n"), "has 2 time stamps for 3 images");
}

/// Milliseconds, most likely; they are not guessed at.
TEST(FrameSource, StampsThatMayNotBeSecondsAreNoted) {
  const ScratchFolder folder;
  constexpr int kEnough = 10;
  for (int i = 0; i < kEnough; ++i)
    folder.write_image(fmt::format("{}.png", i), numbered_image(kWidth, kHeight, i));
  const std::string spec = "images:" + folder.path().string() + "?fx=50&fy=50&cx=32&cy=24";
  const auto notes_at = [&](double interval) {
    std::string times;
    for (int i = 0; i < kEnough; ++i) times += fmt::format("{:.3f}\n", interval * i + (i > 7 ? 5000 : 0));
    folder.write("times.txt", times);
    return open_source(spec)->report().notes;
  };
  const auto notes = notes_at(33.3);
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_NE(
      notes[0].find("times.txt: time stamps are taken as seconds, by which the frames are 33.3 s apart"),
      std::string::npos)
      << notes[0];
  EXPECT_TRUE(open_source(spec + "&fps=0.05")->report().notes.empty()) << "that was asked for";
  EXPECT_TRUE(notes_at(2).empty());
}

TEST(RecordedImages, ShowAnyFrameOfAFolderByItsTime) {
  const ScratchFolder folder;
  for (int i = 0; i < 3; ++i)
    folder.write_image(fmt::format("{}.png", i), numbered_image(kWidth, kHeight, i));
  const std::string spec = "images:" + folder.path().string() + "?fx=50&fy=50&cx=32&cy=24&fps=10";
  const RecordedImages images = images_of_recording(spec, {});
  ASSERT_TRUE(images);
  const auto source = open_source(spec);
  std::vector<Frame> frames(3);
  for (Frame& frame : frames) ASSERT_EQ(source->next(frame), FrameStatus::kFrame);
  for (const std::size_t n : {2U, 0U, 1U})
    EXPECT_EQ(cv::norm(images(frames[n].t_ns), frames[n].left, cv::NORM_INF), 0) << n;
  EXPECT_TRUE(images(frames[1].t_ns + 1).empty());
  EXPECT_TRUE(images(frames[0].t_ns - 1).empty());
  EXPECT_TRUE(images(frames[2].t_ns + 1).empty());
}

TEST(RecordedImages, NothingButFoldersIsOpened) {
  const ScratchFolder folder;
  for (const std::string source :
       {"v4l2:/dev/video99", "synthetic:desk?frames=2", "video:none.mp4", "mcap:none.mcap", "none"})
    EXPECT_FALSE(images_of_recording(source, {})) << source;
  EXPECT_IO_ERROR(images_of_recording("euroc:" + (folder / "gone"), {}), "no such folder");
}

TEST(RecordedImages, OfARecordingThatIsBeingMade) {
  const ScratchFolder folder;
  std::filesystem::create_directories(folder.path() / "mav0" / "cam0" / "data");
  folder.write_image("mav0/cam0/data/123.png", numbered_image(kWidth, kHeight, 7));
  const RecordedImages images = images_being_recorded(folder.path());
  EXPECT_EQ(images(123).at<unsigned char>(0, 5), 7);
  EXPECT_TRUE(images(124).empty());
}

TEST(FrameSource, VideoSideBySide) {
  const ScratchFolder folder;
  const std::string file = folder / "pair.avi";
  cv::VideoWriter writer(file, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25,
                         {2 * kWidth, kHeight});
  if (!writer.isOpened()) GTEST_SKIP() << "OpenCV here cannot write MJPEG";
  for (int i = 0; i < 4; ++i) {
    cv::Mat image(kHeight, 2 * kWidth, CV_8UC3, cv::Scalar::all(40));
    image.colRange(kWidth, 2 * kWidth).setTo(cv::Scalar::all(200));
    writer.write(image);
  }
  writer.release();
  const auto source =
      open_source("video:" + file + "?layout=side-by-side&fx=50&fy=50&cx=32&cy=24&baseline=0.1");
  EXPECT_EQ(source->rig().kind, SensorKind::kStereo);
  EXPECT_EQ(source->rig().camera.width, kWidth);
  Frame frame;
  ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
  EXPECT_NEAR(cv::mean(frame.left)[0], 40, 3);
  EXPECT_NEAR(cv::mean(frame.right)[0], 200, 3);
  ASSERT_EQ(source->next(frame), FrameStatus::kFrame);
  EXPECT_EQ(frame.t_ns, 40'000'000);
  EXPECT_EQ(drain(*source), "2");
}

/// Cameras with 12 bits write them into files of 16: the upper byte alone would be black.
TEST(FrameSource, GreyLevelsOfTwelveBitsAreNotTakenForSixteen) {
  for (const int brightest : {4000, 1000, 60000}) {
    const ScratchFolder folder;
    for (int i = 0; i < 8; ++i) {
      // The first ones are dark, whatever the camera can do.
      cv::Mat image(kHeight, kWidth, CV_16UC1, cv::Scalar(i < 2 ? 600 : brightest / 2));
      if (i >= 2) image.at<std::uint16_t>(3, 5) = static_cast<std::uint16_t>(brightest);
      folder.write_image(fmt::format("{:03d}.png", i), image);
    }
    const auto source =
        open_source("images:" + folder.path().string() + "?fps=10&fx=50&fy=50&cx=31.5&cy=23.5");
    const double white = brightest == 4000 ? 4096 : brightest == 1000 ? 1024 : 65536;
    std::vector<double> grey;
    for (Frame frame; source->next(frame) == FrameStatus::kFrame;) grey.push_back(cv::mean(frame.left)[0]);
    ASSERT_EQ(grey.size(), 8U);
    EXPECT_NEAR(grey.front(), 256 * 600 / white, 1);
    EXPECT_NEAR(grey.back(), 256 * (brightest / 2) / white, 1);
    const auto told = source->report().notes;
    ASSERT_EQ(told.size(), brightest == 60000 ? 0U : 1U);
    for (const std::string& line : told)
      EXPECT_NE(line.find("images of 16 bits hold 1"), std::string::npos) << line;
  }
}

/// A recording may begin in the dark, and may keep eight bits in sixteen.
TEST(FrameSource, ADarkFirstImageOfSixteenBitsSaysNothingOfTheOthers) {
  for (const int brightest : {255, 4000}) {
    const ScratchFolder folder;
    for (int i = 0; i < 8; ++i)
      folder.write_image(fmt::format("{:03d}.png", i),
                         cv::Mat(kHeight, kWidth, CV_16UC1, cv::Scalar(i < 2 ? 160 : brightest)));
    const auto source =
        open_source("images:" + folder.path().string() + "?fps=10&fx=50&fy=50&cx=31.5&cy=23.5");
    std::vector<double> grey;
    for (Frame frame; source->next(frame) == FrameStatus::kFrame;) grey.push_back(cv::mean(frame.left)[0]);
    ASSERT_EQ(grey.size(), 8U);
    EXPECT_NEAR(grey.front(), brightest == 255 ? 160 : 10, 1);
    EXPECT_NEAR(grey.back(), brightest == 255 ? 255 : 250, 1);
    ASSERT_EQ(source->report().notes.size(), 1U);
    EXPECT_NE(source->report().notes[0].find(brightest == 255 ? "16 bits hold 8:" : "16 bits hold 12:"),
              std::string::npos)
        << source->report().notes[0];
  }
}

/// Of 25 numbered images a second; false when OpenCV cannot write that.
bool write_video(const std::string& file, const char* codec, int frames) {
  const int fourcc = cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]);
  cv::VideoWriter writer(file, cv::CAP_FFMPEG, fourcc, 25, {kWidth, kHeight});
  for (int i = 0; i < frames && writer.isOpened(); ++i)
    writer.write(numbered_image(kWidth, kHeight, i, CV_8UC3));
  return writer.isOpened();
}

/// Marks an MP4 file's frames as to be shown turned by 90 degrees, as telephones do that are held upright.
void turn_when_shown(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const std::size_t header = bytes.find("tkhd");
  ASSERT_NE(header, std::string::npos);
  constexpr std::size_t kMatrix = 44;  // from the box's name, in its version 0
  const std::array<unsigned char, 36> turned{0,    0,       0, 0, 0, 1, 0, 0, 0,    0, 0, 0,
                                             0xff, 0xff,    0, 0, 0, 0, 0, 0, 0,    0, 0, 0,
                                             0,    kHeight, 0, 0, 0, 0, 0, 0, 0x40, 0, 0, 0};
  std::copy(turned.begin(), turned.end(), bytes.begin() + static_cast<std::ptrdiff_t>(header + kMatrix));
  std::ofstream(file, std::ios::binary) << bytes;
}

/// Gives the frames of an MP4 file, all of the same length, lengths of their own: (frames, times as long).
/// Its index is the last part of the file, so that it may grow.
void stretch_frames(const std::string& file,
                    const std::vector<std::pair<std::uint32_t, std::uint32_t>>& runs) {
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const auto at = [&](const char* box) {
    const std::size_t name = bytes.find(box);
    if (name == std::string::npos || name < 4) throw std::runtime_error(std::string("no box ") + box);
    return name - 4;
  };
  const auto number = [&](std::size_t from) {
    std::uint32_t n = 0;
    for (std::size_t i = 0; i < 4; ++i) n = n << 8 | static_cast<std::uint8_t>(bytes[from + i]);
    return n;
  };
  const auto big_endian = [](std::uint32_t n) {
    std::string four;
    for (const int shift : {24, 16, 8, 0}) four += static_cast<char>(n >> shift & 255);
    return four;
  };
  const std::size_t stts = at("stts");
  const std::uint32_t length = number(stts + 20);
  std::string table = big_endian(static_cast<std::uint32_t>(runs.size()));
  for (const auto& [frames, times] : runs) table += big_endian(frames) + big_endian(times * length);
  const auto grown = static_cast<std::uint32_t>(table.size() - 12);
  for (const char* box : {"moov", "trak", "mdia", "minf", "stbl", "stts"})
    bytes.replace(at(box), 4, big_endian(number(at(box)) + grown));
  bytes.replace(stts + 12, 12, table);
  bytes.replace(at("edts") + 4, 4, "free");  // it cuts the film to its old length
  std::ofstream(file, std::ios::binary) << bytes;
}

TEST(FrameSource, FramesOfAVideoHaveTheTimesThatTheFileGivesThem) {
  const ScratchFolder folder;
  const std::string file = folder / "telephone.mp4";
  if (!write_video(file, "mp4v", 8)) GTEST_SKIP() << "OpenCV here cannot write MPEG-4";
  stretch_frames(file, {{3, 1}, {1, 7}, {4, 3}});
  const auto times = [&](const std::string& parameters, const SourceOptions& options = {}) {
    const auto source = open_source("video:" + file + parameters, options);
    std::vector<std::int64_t> ms;
    for (Frame frame; source->next(frame) == FrameStatus::kFrame;) ms.push_back(frame.t_ns / 1'000'000);
    return ms;
  };
  const std::vector<std::int64_t> of_file{0, 40, 80, 120, 400, 520, 640, 760};
  EXPECT_EQ(times("?fx=50&fy=50&cx=32&cy=24"), of_file);
  const std::vector<std::int64_t> at_ten{0, 100, 200, 300, 400, 500, 600, 700};
  EXPECT_EQ(times("?fx=50&fy=50&cx=32&cy=24&fps=10"), at_ten);
  SourceOptions with_rate;
  with_rate.calibration = folder.write(
      "lens.yaml", "sensor: mono\nfps: 60\ncameras:\n  - {size: [64, 48], intrinsics: [50, 50, 32, 24]}\n");
  EXPECT_EQ(times("", with_rate), of_file) << "the rate is what the camera was asked for";
}

TEST(FrameSource, APartOfAVideoKeepsNumbersAndTimes) {
  const ScratchFolder folder;
  const std::string file = folder / "part.avi";
  if (!write_video(file, "MJPG", 8)) GTEST_SKIP() << "OpenCV here cannot write MJPEG";
  const std::string camera = "?fx=50&fy=50&cx=32&cy=24";
  const auto source = open_source("video:" + file + camera + "&first=5&frames=2");
  Frame frame;
  for (int i = 5; i < 7; ++i) {
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.index, i);
    EXPECT_EQ(frame.t_ns, i * 40'000'000LL);
  }
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
  EXPECT_TRUE(source->report().faults.empty()) << "it is not cut short";
  const std::string beyond = drain(*open_source("video:" + file + camera + "&first=8"));
  EXPECT_NE(beyond.find("part.avi: first=8: the recording has 8 frames"), std::string::npos) << beyond;
}

TEST(FrameSource, AVideoThatIsCutShortSaysSo) {
  const ScratchFolder folder;
  const std::string file = folder / "cut.avi";
  if (!write_video(file, "MJPG", 40)) GTEST_SKIP() << "OpenCV here cannot write MJPEG";
  const auto faults = [&] {
    const auto source = open_source("video:" + file + "?fx=50&fy=50&cx=32&cy=24");
    EXPECT_TRUE(source->report().faults.empty()) << "its end was not reached";
    (void)drain(*source);
    return source->report().faults;
  };
  EXPECT_TRUE(faults().empty());
  fs::resize_file(file, fs::file_size(file) / 2);
  ASSERT_EQ(faults().size(), 1U);
  EXPECT_NE(faults()[0].find("frames could be decoded of 40 that are announced"), std::string::npos)
      << faults()[0];
}

/// A folder of EuRoC layout with images at these times [ns]: the left ones show 0, 1, ..., the right ones
/// 100, 101, ...
void write_euroc(const ScratchFolder& folder, const std::array<std::vector<std::int64_t>, 2>& times) {
  const char* sensor =
      "T_BS:\n  data: [1,0,0,{}, 0,1,0,0, 0,0,1,0, 0,0,0,1]\nresolution: [64, 48]\n"
      "camera_model: pinhole\nintrinsics: [50, 50, 32, 24]\n";
  for (std::size_t c = 0; c < 2; ++c) {
    std::string list = "#time,file\n";
    for (std::size_t i = 0; i < times[c].size(); ++i) {
      folder.write_image(fmt::format("mav0/cam{}/data/{}.png", c, i),
                         numbered_image(kWidth, kHeight, static_cast<int>(100 * c + i)));
      list += fmt::format("{},{}.png\r\n", times[c][i], i);
    }
    folder.write(fmt::format("mav0/cam{}/data.csv", c), list);
    folder.write(fmt::format("mav0/cam{}/sensor.yaml", c),
                 fmt::format(fmt::runtime(sensor), c == 0 ? "0" : "0.1"));
  }
}

TEST(FrameSource, EurocLeavesOutAndCountsImagesWithoutPartner) {
  constexpr std::int64_t kFrameNs = 50'000'000;
  const ScratchFolder folder;
  write_euroc(folder, {{{0, kFrameNs, 2 * kFrameNs, 3 * kFrameNs}, {0, 2 * kFrameNs, 4 * kFrameNs}}});
  const auto source = open_source(folder.path().string());
  EXPECT_NEAR(source->rig().baseline, 0.1, 1e-12);
  EXPECT_EQ(numbers_of(*source), (Numbers{{0, 100}, {2, 101}}));
  EXPECT_EQ(source->report().lost, 3U);
  ASSERT_EQ(source->report().summary.size(), 1U);
  EXPECT_NE(source->report().summary[0].find("3 images without a partner"), std::string::npos);
}

/// Cameras that are triggered together do not stamp to the nanosecond.
TEST(FrameSource, EurocPairsTheNearestInTime) {
  constexpr std::int64_t kFrameNs = 50'000'000;
  const ScratchFolder folder;
  const std::string name = "euroc:" + folder.path().string();
  write_euroc(folder, {{{kFrameNs, 2 * kFrameNs, 3 * kFrameNs},
                        {kFrameNs + 1000, 2 * kFrameNs - 900'000, 3 * kFrameNs + 900'000}}});
  const auto source = open_source(name);
  EXPECT_EQ(numbers_of(*source), (Numbers{{0, 100}, {1, 101}, {2, 102}}));
  EXPECT_TRUE(source->report().notes.empty());
  EXPECT_IO_ERROR(open_source(name + "?max_gap=0.0001"),
                  "of 3 images of cam0 and 3 of cam1 only 1 are within 0.0001 s (max_gap)");
  EXPECT_EQ(numbers_of(*open_source(name + "?max_gap=0.0001&unpaired=drop")), (Numbers{{0, 100}}));
  EXPECT_IO_ERROR(open_source(name + "?max_gap=0&unpaired=drop"),
                  "no images of cam0 and cam1 are within 0 s");
  EXPECT_IO_ERROR(open_source(name + "?max_gap=2"), "max_gap must be from 0 to 1 s");
}

/// What the left camera alone of a source gives: how many frames, or the error.
std::string left_alone(const std::string& name, const std::optional<fs::path>& calibration = {}) {
  const auto source = open_source(name, {.calibration = calibration, .left_only = true});
  EXPECT_EQ(source->rig().kind, SensorKind::kMono) << name;
  EXPECT_EQ(source->rig().baseline, 0) << name;
  return drain(*source);
}

const char* const kOneCamera = "sensor: mono\ncameras:\n  - {size: [64, 48], intrinsics: [50, 50, 32, 24]}\n";

TEST(LeftCameraAlone, OfEurocNeedsNothingOfTheRightOne) {
  const ScratchFolder folder;
  const std::string name = "euroc:" + folder.path().string();
  write_euroc(folder, {{{1000, 1001, 1002}, {1000, 1001}}});
  folder.write("mav0/cam1/data/0.png", "damaged");
  EXPECT_EQ(left_alone(name), "3");
  EXPECT_EQ(left_alone(name + "?unpaired=drop&max_gap=0"), "3");
  EXPECT_EQ(left_alone(name, folder.write("mono.yaml", kOneCamera)), "3");
  const RecordedImages images = images_of_recording(name, {});
  EXPECT_FALSE(images(1002).empty());
  fs::remove(folder / "mav0/cam1/data.csv");
  fs::remove(folder / "mav0/cam1/sensor.yaml");
  EXPECT_EQ(left_alone(name), "3");
  EXPECT_IO_ERROR(open_source(name), "cam1/sensor.yaml");
}

TEST(LeftCameraAlone, OfKittiNeedsNothingOfTheRightOne) {
  const ScratchFolder folder;
  write_kitti(folder);
  folder.write("image_1/000001.png", "damaged");
  fs::remove(folder / "image_1/000004.png");
  EXPECT_EQ(left_alone(folder.path().string()), "5");
  EXPECT_EQ(left_alone(folder.path().string(), folder.write("mono.yaml", kOneCamera)), "5");
}

TEST(LeftCameraAlone, OfTumNeedsNoDepth) {
  const ScratchFolder folder;
  write_tum(folder);
  fs::remove_all(folder / "depth");
  const std::string name = "tum:" + folder.path().string() + "?fx=50&fy=50&cx=32&cy=24";
  EXPECT_EQ(left_alone(name), "5") << "one of them has no depth image near it";
  fs::remove(folder / "depth.txt");
  EXPECT_EQ(left_alone(name), "5");
  EXPECT_IO_ERROR(open_source(name), "depth.txt: no such file");
}

TEST(LeftCameraAlone, OfAFolderNeedsNothingOfTheOtherOne) {
  for (const std::string other : {"right", "depth"}) {
    const ScratchFolder folder;
    for (int i = 0; i < 3; ++i)
      folder.write_image(fmt::format("left/{}.png", i), numbered_image(kWidth, kHeight, i));
    folder.write(other + "/0.png", "damaged");
    const std::string name = "images:" + folder.path().string() + "?fps=10";
    EXPECT_EQ(left_alone(name + "&fx=50&fy=50&cx=32&cy=24"), "3");
    EXPECT_EQ(left_alone(name, folder.write("mono.yaml", kOneCamera)), "3");
    fs::remove(folder / (other + "/0.png"));
    EXPECT_EQ(left_alone(name, folder / "mono.yaml"), "3");
  }
}

/// Each frame's own, in whatever order they are asked for, while others are read.
TEST(FrameSource, AVideoGivesTheColoursOfItsFrames) {
  constexpr int kFrames = 9;
  const auto colours_of = [](int number) {
    cv::Mat image(kHeight, kWidth, CV_8UC3, cv::Scalar(30 + 20 * number, 60, 200 - 20 * number));
    image.colRange(kWidth / 2, kWidth).setTo(cv::Scalar(0, 0, 0));
    return image;
  };
  for (const char* codec : {"MJPG", "mp4v"}) {
    const ScratchFolder folder;
    const std::string file = folder / (codec == std::string("mp4v") ? "a.mp4" : "a.avi");
    const int fourcc = cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]);
    cv::VideoWriter writer(file, cv::CAP_FFMPEG, fourcc, 25, {kWidth, kHeight});
    if (!writer.isOpened()) GTEST_SKIP() << "OpenCV here cannot write " << codec;
    for (int i = 0; i < kFrames; ++i) writer.write(colours_of(i));
    writer.release();
    const auto expect_colours = [&](const FrameSource& source, int i, int columns) {
      const cv::Mat colour = source.colour_image(i);
      ASSERT_EQ(colour.type(), CV_8UC3);
      ASSERT_EQ(colour.size(), cv::Size(columns, kHeight));
      const cv::Rect inside(2, 2, kWidth / 2 - 4, kHeight - 4);
      const cv::Scalar seen = cv::mean(colour(inside)), written = cv::mean(colours_of(i)(inside));
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen[c], written[c], 6) << codec << " " << i;
    };
    const auto whole = open_source("video:" + file + "?fx=50&fy=50&cx=32&cy=24&first=1");
    Frame frame;
    for (int i = 1; i < kFrames; ++i) {
      ASSERT_EQ(whole->next(frame), FrameStatus::kFrame) << whole->error();
      if (i % 3 == 0) expect_colours(*whole, i, kWidth);
    }
    for (const int i : {2, 2, 7, 1, 8}) expect_colours(*whole, i, kWidth);
    EXPECT_IO_ERROR((void)whole->colour_image(kFrames), "frame 9 cannot be decoded again");
    EXPECT_TRUE(whole->colour_image(-1).empty());
    const auto pair =
        open_source("video:" + file + "?layout=side-by-side&fx=50&fy=50&cx=16&cy=24&baseline=0.1");
    ASSERT_EQ(pair->next(frame), FrameStatus::kFrame) << pair->error();
    expect_colours(*pair, 0, kWidth / 2);
  }
}

/// A rolling shutter reads the sensor's rows, and a calibration is of the sensor.
TEST(FrameSource, AVideoComesAsTheSensorHasIt) {
  const ScratchFolder folder;
  const std::string file = folder / "upright.mp4";
  if (!write_video(file, "mp4v", 3)) GTEST_SKIP() << "OpenCV here cannot write MPEG-4";
  turn_when_shown(file);
  cv::VideoCapture shown(file, cv::CAP_FFMPEG);
  cv::Mat image;
  ASSERT_TRUE(shown.read(image));
  ASSERT_EQ(image.cols, kHeight) << "the file is not marked";
  const auto source = open_source("video:" + file + "?fx=50&fy=50&cx=32&cy=24");
  Frame frame;
  ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
  EXPECT_EQ(frame.left.size(), cv::Size(kWidth, kHeight));
}

TEST(LeftCameraAlone, OfASideBySideVideoNeedsOneCalibration) {
  const ScratchFolder folder;
  const std::string file = folder / "pair.avi";
  cv::VideoWriter writer(file, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25,
                         {2 * kWidth, kHeight});
  if (!writer.isOpened()) GTEST_SKIP() << "OpenCV here cannot write MJPEG";
  for (int i = 0; i < 4; ++i) writer.write(cv::Mat(kHeight, 2 * kWidth, CV_8UC3, cv::Scalar::all(40)));
  writer.release();
  const std::string name = "video:" + file + "?layout=side-by-side";
  EXPECT_EQ(left_alone(name + "&fx=50&fy=50&cx=32&cy=24"), "4");
  EXPECT_EQ(left_alone(name + "&fx=50&fy=50&cx=32&cy=24&baseline=0.1"), "4");
  EXPECT_EQ(left_alone(name, folder.write("mono.yaml", kOneCamera)), "4");
}

}  // namespace
}  // namespace twofold
