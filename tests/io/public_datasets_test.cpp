#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/sources/open_source.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 640, kHeight = 480, kLength = 3;

/// A recording that lists its images as TUM's benchmark does, or under OpenLORIS' names.
void write_listed(const ScratchFolder& folder, const std::string& name, const std::string& colour = "rgb",
                  const std::string& depth = "depth") {
  std::string colour_list, depth_list;
  for (int i = 0; i < kLength; ++i) {
    const std::string file = fmt::format("{:.6f}.png", 10 + 0.1 * i);
    cv::Mat image = numbered_image(kWidth, kHeight, 50 + i, CV_8UC3);
    folder.write_image(fmt::format("{}/{}/{}", name, colour, file), image);
    folder.write_image(fmt::format("{}/{}/{}", name, depth, file),
                       cv::Mat(kHeight, kWidth, CV_16UC1, cv::Scalar(1000 + i)));
    colour_list += fmt::format("{:.6f} {}/{}\n", 10 + 0.1 * i, colour, file);
    depth_list += fmt::format("{:.6f} {}/{}\n", 10 + 0.1 * i, depth, file);
  }
  folder.write(name + "/" + (colour == "rgb" ? "rgb" : "color") + ".txt", colour_list);
  folder.write(name + "/" + depth + ".txt", depth_list);
}

std::string lens_file(const std::string& intrinsics, const std::string& coefficients) {
  return "sensor: rgbd\ncameras:\n  - size: [640, 480]\n    intrinsics: [" + intrinsics + "]\n" +
         (coefficients.empty() ? ""
                               : "    distortion: {model: radtan, coefficients: [" + coefficients + "]}\n");
}

std::string all_notes(const FrameSource& source) {
  std::string text;
  for (const std::string& note : source.report().notes) text += note + "\n";
  return text;
}

Frame first_frame(FrameSource& source) {
  Frame frame;
  EXPECT_EQ(source.next(frame), FrameStatus::kFrame) << source.error();
  return frame;
}

void expect_same_camera(FrameSource& source, FrameSource& expected) {
  const PinholeCamera &a = source.rig().camera, &b = expected.rig().camera;
  EXPECT_EQ((std::vector{a.fx, a.fy, a.cx, a.cy}), (std::vector{b.fx, b.fy, b.cx, b.cy}));
  EXPECT_EQ(source.rig().depth_unit, expected.rig().depth_unit);
  EXPECT_EQ(cv::norm(first_frame(source).left, first_frame(expected).left, cv::NORM_INF), 0);
}

struct Published {
  const char* folder;
  const char* dataset;
  const char* intrinsics;
  const char* coefficients;
};

class PublishedCalibration : public ::testing::TestWithParam<Published> {};

TEST_P(PublishedCalibration, IsTakenByTheNameOfTheFolder) {
  const Published& published = GetParam();
  const ScratchFolder folder;
  write_listed(folder, published.folder);
  const auto lens = folder.write("lens.yaml", lens_file(published.intrinsics, published.coefficients));
  // A lens costs seconds a source under AddressSanitizer: how a folder may end is tried where there is none.
  std::vector<std::string> ends = {""};
  if (*published.coefficients == 0) ends.insert(ends.end(), {"/", "/."});
  for (const std::string& end : ends) {
    const auto source = open_source((folder / published.folder) + end);
    EXPECT_EQ(source->rig().kind, SensorKind::kRgbd);
    EXPECT_NE(all_notes(*source).find(fmt::format("calibration as published for {} (", published.dataset)),
              std::string::npos)
        << all_notes(*source);
    expect_same_camera(*source, *open_source(folder / published.folder, {.calibration = lens}));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Benchmarks, PublishedCalibration,
    ::testing::Values(Published{"rgbd_dataset_freiburg1_desk", "TUM RGB-D, Freiburg 1",
                                "517.306408, 516.469215, 318.643040, 255.313989",
                                "0.262383, -0.953104, -0.005358, 0.002628, 1.163314"},
                      Published{"rgbd_dataset_freiburg2_pioneer_slam", "TUM RGB-D, Freiburg 2",
                                "520.908620, 521.007327, 325.141442, 249.701764",
                                "0.231222, -0.784899, -0.003257, -0.000105, 0.917205"},
                      Published{"rgbd_dataset_freiburg3_walking_xyz_validation", "TUM RGB-D, Freiburg 3",
                                "535.4, 539.2, 320.1, 247.6", ""},
                      Published{"rgbd_bonn_balloon", "Bonn RGB-D Dynamic",
                                "542.822841, 542.576870, 315.593520, 237.756098",
                                "0.039903, -0.099343, -0.000730, -0.000144, 0"}));

/// Focal length, and whether the published calibration was said to be in use.
std::pair<double, bool> focal_length_of(const std::string& text, const SourceOptions& options = {}) {
  const auto source = open_source(text, options);
  return {source->rig().camera.fx, all_notes(*source).find("as published") != std::string::npos};
}

TEST(PublicDatasets, WhatUserAndFolderSayGoesBeforeWhatWasPublished) {
  using Found = std::pair<double, bool>;
  const ScratchFolder folder;
  const std::string path = folder / "freiburg3_mine";
  write_listed(folder, "freiburg3_mine");
  EXPECT_EQ(focal_length_of(path), Found(535.4, true));
  EXPECT_EQ(focal_length_of("tum:" + path, {.calibration = {}, .left_only = true}), Found(535.4, true));
  EXPECT_EQ(focal_length_of(path + "?fx=500&fy=500&cx=320&cy=240"), Found(500, false));
  EXPECT_IO_ERROR(open_source(path + "?fx=500"), "'fy' is missing");
  EXPECT_EQ(open_source(path + "?depth_scale=1000")->rig().depth_unit, 0.001);
  const SourceOptions found_from_the_video{.calibration = {}, .suppose_camera = true, .left_only = true};
  EXPECT_EQ(focal_length_of(path, found_from_the_video), Found(1000, false));
  folder.write("freiburg3_mine/camera.txt", "fx 510\nfy 510\ncx 320\ncy 240\n");
  EXPECT_EQ(focal_length_of(path), Found(510, false));
  folder.write("freiburg3_mine/calibration.yaml", lens_file("520, 520, 320, 240", ""));
  EXPECT_EQ(focal_length_of(path), Found(520, false));
  const auto given = folder.write("lens.yaml", lens_file("530, 530, 320, 240", ""));
  EXPECT_EQ(focal_length_of(path, {.calibration = given}), Found(530, false));
}

TEST(PublicDatasets, PublishedCamerasAreForPublishedSizes) {
  const ScratchFolder folder;
  write_listed(folder, "freiburg3_small");
  for (const auto& entry : fs::directory_iterator(folder.path() / "freiburg3_small" / "rgb"))
    cv::imwrite(entry.path().string(), numbered_image(320, 240, 1, CV_8UC3));
  EXPECT_IO_ERROR(open_source(folder / "freiburg3_small"), "the image is 320x240");
}

TEST(PublicDatasets, OthersOfThatLayoutAreAskedFor) {
  const ScratchFolder folder;
  write_listed(folder, "rgbd_dataset_mine");
  EXPECT_IO_ERROR(open_source(folder / "rgbd_dataset_mine"), "no calibration: give --calib FILE");
}

TEST(PublicDatasets, Eth3dSaysItsCameraInOneLine) {
  const ScratchFolder folder;
  const std::string path = folder / "cables_1";
  write_listed(folder, "cables_1");
  const auto file =
      folder.write("cables_1/calibration.txt", "726.28741455 726.28741455 354.6496887 186.46566772\n");
  const auto source = open_source(path);
  EXPECT_EQ(source->rig().camera.fx, 726.28741455);
  EXPECT_EQ(source->rig().camera.cy, 186.46566772);
  EXPECT_EQ(source->rig().camera.width, kWidth);
  EXPECT_EQ(source->rig().depth_unit, 1.0 / 5000);
  EXPECT_EQ(read_calibration(file).left.pinhole.cx, 354.6496887) << "by --calib, too";
  for (const std::string damaged :
       {"726.3 726.3 354.6\n", "726.3 726.3 354.6 nan\n", "a b c d\n", "", "726.3 726.3 354.6 186.5 0\n"}) {
    folder.write("cables_1/calibration.txt", damaged);
    EXPECT_IO_ERROR(open_source(path), "calibration.txt");
    EXPECT_EQ(open_source(path + "?fx=500&fy=500&cx=320&cy=240")->rig().camera.fx, 500);
  }
  folder.write("cables_1/calibration.txt", "-726.3 726.3 354.6 186.5\n");
  EXPECT_IO_ERROR(open_source(path), "calibration.txt: left camera");
  folder.write("cables_1/calibration.txt", "726.3 726.3 354.6 186.5\n");
  fs::remove(folder.path() / "cables_1" / "depth.txt");
  EXPECT_IO_ERROR(open_source(path), "depth.txt: no such file (--camera mono runs the colour camera alone)");
  EXPECT_EQ(open_source(path, {.calibration = {}, .left_only = true})->frame_count(), kLength);
}

constexpr const char* kOpenLorisSensors =
    "%YAML:1.0\n---\nd400_color_optical_frame:\n   sensor_type: camera\n   fps: 30\n   width: 640\n   "
    "height: 480\n"
    "   model: pinhole\n   intrinsics: !!opencv-matrix\n      rows: 1\n      cols: 4\n      dt: d\n"
    "      data: [ 6.11e+02, 3.23e+02, 6.12e+02,\n          2.49e+02 ]\n"
    "   distortion_coefficients: !!opencv-matrix\n      rows: 1\n      cols: 5\n      dt: d\n"
    "      data: [ 0., 0., 0., 0., 0. ]\n";

std::string mount(const std::string& parent, const std::string& child, const std::string& matrix) {
  return fmt::format(
      "  -\n    parent_frame: {}\n    child_frame: {}\n    matrix: !!opencv-matrix\n      rows: 4\n"
      "      cols: 4\n      dt: d\n      data: [{}, 0., 0., 0., 1.]\n",
      parent, child, matrix);
}

TEST(PublicDatasets, OpenLorisWithoutLinks) {
  const ScratchFolder folder;
  const std::string path = folder / "home1-1";
  write_listed(folder, "home1-1", "color", "aligned_depth");
  EXPECT_IO_ERROR(open_source(path), "no calibration: give --calib FILE");
  folder.write("home1-1/sensors.yaml", kOpenLorisSensors);
  // The camera looks along the base's x axis, 0.5 m ahead of it and 0.9 m up.
  folder.write("home1-1/trans_matrix.yaml",
               "%YAML:1.0\n---\ntrans_matrix:\n" +
                   mount("laser", "d400_color_optical_frame", "0, 0, 1, 0.3, -1, 0, 0, 0, 0, -1, 0, 0.4") +
                   mount("base_link", "laser", "1, 0, 0, 0.2, 0, 1, 0, 0, 0, 0, 1, 0.5"));
  // Turned to the left by 90 degrees.
  folder.write("home1-1/groundtruth.txt",
               "#Time px py pz qx qy qz qw:\n10.0 1 2 0 0 0 0.70710678 0.70710678\n");
  const auto source = open_source(path);
  const PinholeCamera& camera = source->rig().camera;
  EXPECT_EQ((std::vector{camera.fx, camera.fy, camera.cx, camera.cy}), (std::vector{611., 612., 323., 249.}));
  EXPECT_EQ(source->rig().depth_unit, 0.001);
  EXPECT_EQ(first_frame(*source).depth.at<std::uint16_t>(7, 7), 1000);
  ASSERT_EQ(source->ground_truth().size(), 1U);
  const SE3& T_w_c = source->ground_truth()[0].T_w_c;
  EXPECT_LT((T_w_c.translation() - Vector3(1, 2.5, 0.9)).norm(), 1e-6);
  EXPECT_LT((T_w_c.rotation().col(2) - Vector3(0, 1, 0)).norm(), 1e-6) << "looks along the world's y";
  EXPECT_LT((T_w_c.rotation().col(1) - Vector3(0, 0, -1)).norm(), 1e-6) << "its y axis points down";
}

TEST(PublicDatasets, OpenLorisWithDamagedFiles) {
  const ScratchFolder folder;
  const std::string path = folder / "home1-1";
  write_listed(folder, "home1-1", "color", "aligned_depth");
  folder.write("home1-1/sensors.yaml", kOpenLorisSensors);
  folder.write("home1-1/groundtruth.txt", "10.0 1 2 0 0 0 0 1\n");
  const auto note_with = [&](const std::string& transforms) {
    folder.write("home1-1/trans_matrix.yaml", transforms);
    const auto source = open_source(path);
    EXPECT_TRUE(source->ground_truth().empty()) << "it would be the base's";
    return all_notes(*source);
  };
  const std::string unit = "1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0";
  for (const std::string& transforms : {"trans_matrix:\n" + mount("base_link", "laser", unit),
                                        "trans_matrix:\n" + mount("laser", "d400_color_optical_frame", unit) +
                                            mount("d400_color_optical_frame", "laser", unit)})
    EXPECT_NE(note_with(transforms).find("does not say how d400_color_optical_frame sits in base_link"),
              std::string::npos);
  EXPECT_NE(note_with("trans_matrix:\n" + mount("base_link", "d400_color_optical_frame", "1, 0, 0"))
                .find("has 7 numbers"),
            std::string::npos);
  EXPECT_NE(note_with("nothing: 1\n").find("key 'trans_matrix' is missing"), std::string::npos);
  folder.write("home1-1/sensors.yaml",
               "d400_color_optical_frame: {width: 640, height: 480, intrinsics: {data: [1, 2, 3]}}\n");
  EXPECT_IO_ERROR(open_source(path),
                  "sensors.yaml:1: key 'd400_color_optical_frame.intrinsics.data' has 3 numbers");
  fs::remove(folder.path() / "home1-1" / "aligned_depth.txt");
  EXPECT_IO_ERROR(open_source(path), "aligned_depth.txt: no such file (--camera mono");
}

void write_icl_nuim(const ScratchFolder& folder, const std::string& name) {
  std::string associations;
  for (int i = 1; i <= kLength; ++i) {
    folder.write_image(fmt::format("{}/rgb/{}.png", name, i),
                       numbered_image(kWidth, kHeight, 50 + i, CV_8UC3));
    folder.write_image(fmt::format("{}/depth/{}.png", name, i),
                       cv::Mat(kHeight, kWidth, CV_16UC1, cv::Scalar(10000 + i)));
    associations += fmt::format("{} depth/{}.png {} rgb/{}.png\n", i, i, i, i);
  }
  folder.write(name + "/associations.txt", associations);
}

TEST(PublicDatasets, IclNuimCountsFramesAndMirrorsItsTruth) {
  const ScratchFolder folder;
  write_icl_nuim(folder, "traj2");
  EXPECT_IO_ERROR(open_source(folder / "traj2"), "no calibration");
  folder.write("traj2/livingRoom2.gt.freiburg",
               "1 0 0 -2.25 0 0 0 1\n2 0.5 0.25 -2 0.1 0.2 0.3 0.927361849549570\n");
  const auto source = open_source(folder / "traj2");
  EXPECT_NE(all_notes(*source).find("as published for ICL-NUIM"), std::string::npos);
  EXPECT_EQ(source->rig().depth_unit, 1.0 / 5000);
  const Frame frame = first_frame(*source);
  EXPECT_EQ(frame.t_ns, 33'333'333) << "the first frame's number is 1";
  ASSERT_EQ(source->ground_truth().size(), 2U);
  EXPECT_EQ(source->ground_truth()[0].t_ns, frame.t_ns);
  // A point as the renderer projects it, whose y points up, is where the source's camera sees it.
  const SE3 T_w_c_renderer(SO3(Eigen::Quaterniond(0.927361849549570, 0.1, 0.2, 0.3)), Vector3(0.5, 0.25, -2));
  const Vector3 p_renderer(0.4, 0.9, 1.5), p_w(0.4, -0.9, 1.5);
  const Vector3 p_c = T_w_c_renderer.inverse() * p_renderer;
  const Vector2 pixel(481.2 * p_c.x() / p_c.z() + 319.5, -480.0 * p_c.y() / p_c.z() + 239.5);
  const SE3 T_c_w = source->ground_truth()[1].T_w_c.inverse();
  EXPECT_LT((source->rig().camera.project(T_c_w * p_w) - pixel).norm(), 1e-9);
}

TEST(PublicDatasets, IclNuimByTheNameOfItsFolder) {
  const ScratchFolder folder;
  write_icl_nuim(folder, "living_room_traj2_frei_png");
  const auto source = open_source(folder / "living_room_traj2_frei_png");
  EXPECT_EQ(source->rig().camera.fy, 480);
  EXPECT_TRUE(source->ground_truth().empty());
  EXPECT_EQ(first_frame(*source).t_ns, 33'333'333);
}

TEST(PublicDatasets, AFocalLengthOfAxesThatPointUpIsExplained) {
  const ScratchFolder folder;
  write_icl_nuim(folder, "traj2");
  EXPECT_IO_ERROR(
      open_source((folder / "traj2") + "?fx=481.2&fy=-480&cx=319.5&cy=239.5"),
      "fy=-480 is of axes whose y points up, as a renderer has them; images begin at their top row: "
      "take fy=480");
}

/// A sequence of 7-Scenes: the camera moves by 0.1 m a frame, along the world's x.
void write_seven_scenes(const ScratchFolder& folder, const std::string& name,
                        const std::vector<int>& numbers) {
  for (const int n : numbers) {
    const std::string frame = fmt::format("{}/frame-{:06d}.", name, n);
    folder.write_image(frame + "color.png", numbered_image(kWidth, kHeight, 50 + n, CV_8UC3));
    cv::Mat depth(kHeight, kWidth, CV_16UC1, cv::Scalar(1000 + n));
    depth.row(3).setTo(65535);
    folder.write_image(frame + "depth.png", depth);
    folder.write(frame + "pose.txt", fmt::format("0.0 0.0 1.0 {} \n1.0 0.0 0.0 2.0\t\n0.0 1.0 0.0 3.0\n"
                                                 "0.0000000e+000 0.0 0.0 1.0\n",
                                                 0.1 * n));
  }
}

TEST(PublicDatasets, SevenScenesAsUnpacked) {
  const ScratchFolder folder;
  write_seven_scenes(folder, "seq-01", {0, 1, 2, 9, 10});
  for (const std::string scheme : {"", "7scenes:"}) {
    const auto source = open_source(scheme + (folder / "seq-01"));
    EXPECT_EQ(source->rig().kind, SensorKind::kRgbd);
    const PinholeCamera& camera = source->rig().camera;
    EXPECT_EQ((std::vector{camera.fx, camera.fy, camera.cx, camera.cy}),
              (std::vector{585., 585., 320., 240.}));
    EXPECT_EQ(source->rig().depth_unit, 0.001);
    EXPECT_NE(all_notes(*source).find("as published for 7-Scenes"), std::string::npos);
    EXPECT_EQ(source->frame_count(), 5);
    ASSERT_EQ(source->ground_truth().size(), 5U);
    EXPECT_EQ(source->ground_truth()[4].t_ns, 333'333'333);
    const SE3& T_w_c = source->ground_truth()[4].T_w_c;
    EXPECT_LT((T_w_c * Vector3(1, 0, 0) - Vector3(1, 3, 3)).norm(), 1e-12);
    std::vector<std::int64_t> times;
    for (Frame frame; source->next(frame) == FrameStatus::kFrame;) {
      times.push_back(frame.t_ns);
      EXPECT_EQ(frame.depth.at<std::uint16_t>(7, 7) - 1000, frame.left.at<unsigned char>(0, 5) - 50);
    }
    EXPECT_EQ(times, (std::vector<std::int64_t>{0, 33'333'333, 66'666'667, 300'000'000, 333'333'333}))
        << "frames that are not there are gaps";
  }
  const auto believed = open_source((folder / "seq-01") + "?depth_max=100&fps=10");
  EXPECT_LT(believed->rig().depth_max, 65.535) << "no reading remains none";
  EXPECT_EQ(believed->ground_truth()[1].t_ns, 100'000'000);
  EXPECT_EQ(open_source((folder / "seq-01") + "?fx=525&fy=525&cx=320&cy=240")->rig().camera.fx, 525);
  const auto lens = folder.write("lens.yaml", lens_file("530, 530, 320, 240", ""));
  const auto given = open_source(folder / "seq-01", {.calibration = lens});
  EXPECT_EQ(given->rig().camera.fx, 530);
  EXPECT_EQ(all_notes(*given), "");
}

TEST(PublicDatasets, SevenScenesWithoutAllOfIt) {
  const ScratchFolder folder;
  const std::string path = folder / "seq-01";
  write_seven_scenes(folder, "seq-01", {0, 1, 2, 3});
  const auto file = [&](const std::string& name) { return folder.path() / "seq-01" / name; };
  fs::remove(file("frame-000001.pose.txt"));
  folder.write("seq-01/frame-000002.pose.txt", "nan -inf inf 0 0 0 0 0 0 0 0 0 0 0 0 1\n");
  EXPECT_EQ(open_source(path)->ground_truth().size(), 2U);
  for (const std::string damaged : {"1 0 0 0 0 1 0 0 0 0 1 0 0 0 0\n", "2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n",
                                    "1 0 0 x 0 1 0 0 0 0 1 0 0 0 0 1\n", ""}) {
    folder.write("seq-01/frame-000002.pose.txt", damaged);
    const auto source = open_source(path);
    EXPECT_TRUE(source->ground_truth().empty()) << damaged;
    EXPECT_NE(all_notes(*source).find("frame-000002.pose.txt"), std::string::npos);
  }
  EXPECT_IO_ERROR(open_source(path + "?fps=1e-10"), "beyond all times");
  fs::remove(file("frame-000003.color.png"));
  EXPECT_IO_ERROR(open_source(path), "frame-000003.depth.png: no colour image has its number (unpaired=drop");
  fs::remove(file("frame-000001.depth.png"));
  EXPECT_IO_ERROR(open_source(path), "frame-000001.color.png: no depth image has its number");
  EXPECT_EQ(open_source(path, {.calibration = {}, .left_only = true})->frame_count(), 3);
  const auto source = open_source(path + "?unpaired=drop");
  EXPECT_EQ(source->frame_count(), 2);
  EXPECT_EQ(source->report().lost, 2U);
  folder.write("seq-01/frame-02.color.png", "");
  EXPECT_IO_ERROR(open_source(path), "has the same number as");
  EXPECT_IO_ERROR(open_source("7scenes:" + folder.path().string()),
                  "no images called frame-NUMBER.color.png");
}

constexpr const char* kReplicaCamera =
    R"({"camera": {"w": 120, "h": 68, "fx": 60.0, "fy": 60.0, "cx": 59.5, "cy": 33.5, "scale": 6553.5}})";

/// A scene of Replica as NICE-SLAM hands it on, smaller; the camera moves by 0.1 m a frame.
void write_replica(const ScratchFolder& folder, int width, int height) {
  std::string path;
  for (int i = 0; i < kLength; ++i) {
    folder.write_image(fmt::format("office0/results/frame{:06d}.jpg", i),
                       numbered_image(width, height, 50, CV_8UC3));
    folder.write_image(fmt::format("office0/results/depth{:06d}.png", i),
                       cv::Mat(height, width, CV_16UC1, cv::Scalar(6000 + i)));
    path += fmt::format("0 0 1 {} 1 0 0 2 0 1 0 3 0 0 0 1\n", 0.1 * i);
  }
  folder.write("office0/traj.txt", path);
}

TEST(PublicDatasets, ReplicaAsHandedOn) {
  const ScratchFolder folder;
  const std::string path = folder / "office0";
  write_replica(folder, 120, 68);
  EXPECT_IO_ERROR(open_source(path), "the image is 120x68, the calibration (" + path + ") is for 1200x680");
  folder.write("cam_params.json", kReplicaCamera);
  for (const std::string& text : {path, path + "/", "replica:" + path}) {
    const auto source = open_source(text);
    EXPECT_EQ(source->rig().kind, SensorKind::kRgbd);
    EXPECT_EQ(source->rig().camera.fx, 60);
    EXPECT_EQ(source->rig().camera.cy, 33.5);
    EXPECT_EQ(source->rig().depth_unit, 1 / 6553.5);
    EXPECT_EQ(source->rig().readout, 0.0);
    ASSERT_EQ(source->ground_truth().size(), std::size_t{kLength});
    EXPECT_EQ(source->ground_truth()[2].t_ns, 66'666'667);
    EXPECT_LT((source->ground_truth()[2].T_w_c * Vector3(1, 0, 0) - Vector3(0.2, 3, 3)).norm(), 1e-12);
    EXPECT_EQ(first_frame(*source).depth.at<std::uint16_t>(7, 7), 6000);
  }
  EXPECT_EQ(open_source(path + "?fx=61&fy=61&cx=60&cy=34")->rig().depth_unit, 1 / 6553.5);
}

TEST(PublicDatasets, ReplicaWithItsPublishedCamera) {
  const ScratchFolder folder;
  write_replica(folder, 1200, 680);
  const auto source = open_source(folder / "office0");
  EXPECT_EQ(source->rig().camera.fx, 600);
  EXPECT_EQ(source->rig().depth_unit, 1 / 6553.5);
  EXPECT_NE(all_notes(*source).find("as published for Replica"), std::string::npos);
}

TEST(PublicDatasets, ReplicaWithDamagedFiles) {
  const ScratchFolder folder;
  const std::string path = folder / "office0";
  write_replica(folder, 120, 68);
  const std::string whole = kReplicaCamera;
  const auto without = [&](const std::string& part, const std::string& by) {
    return std::string(whole).replace(whole.find(part), part.size(), by);
  };
  for (const std::string& damaged :
       {std::string(), std::string("[1]"), std::string("{}"), whole.substr(0, 40), without("60.0", "\"60\""),
        without("6553.5", "0"), without("120", "-120"), without("120", "1e300"),
        without("\"cx\"", "\"x\"")}) {
    folder.write("office0/cam_params.json", damaged);
    EXPECT_IO_ERROR(open_source(path), "cam_params.json");
  }
  folder.write("office0/cam_params.json", whole);
  folder.write("office0/traj.txt", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n");
  const auto source = open_source(path);
  EXPECT_TRUE(source->ground_truth().empty());
  EXPECT_NE(all_notes(*source).find("traj.txt: has 1 poses, none for frame000001.jpg"), std::string::npos);
  fs::remove(folder.path() / "office0/results/depth000001.png");
  EXPECT_IO_ERROR(open_source(path), "frame000001.jpg: no depth image has its number");
}

std::string matrix_of(double f, double cx, double cy) {
  return fmt::format("{} 0 {} 0\n0 {} {} 0\n0 0 1 0\n0 0 0 1\n", f, cx, f, cy);
}

/// A scene of ScanNet as its program exports it, smaller: numbers are not filled up, and colour images are
/// larger than depth images.
void write_scannet(const ScratchFolder& folder) {
  for (const int n : {0, 9, 10, 11}) {
    folder.write_image(fmt::format("scene0/color/{}.jpg", n), numbered_image(324, 242, 50, CV_8UC3));
    folder.write_image(fmt::format("scene0/depth/{}.png", n),
                       cv::Mat(120, 160, CV_16UC1, cv::Scalar(2000 + n)));
    folder.write(fmt::format("scene0/pose/{}.txt", n),
                 "1 0 0 " + std::to_string(n) + "\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  }
  folder.write("scene0/pose/10.txt",
               "-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n");
  folder.write("scene0/intrinsic/intrinsic_color.txt", matrix_of(290, 162, 121));
  folder.write("scene0/intrinsic/intrinsic_depth.txt", matrix_of(145, 80, 60));
  folder.write("scene0/intrinsic/extrinsic_color.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
}

TEST(PublicDatasets, ScanNetWithImagesOfTwoSizes) {
  const ScratchFolder folder;
  write_scannet(folder);
  for (const std::string scheme : {"", "scannet:"}) {
    const auto source = open_source(scheme + (folder / "scene0"));
    EXPECT_EQ(source->rig().kind, SensorKind::kRgbd);
    EXPECT_EQ(source->rig().camera.fx, 290);
    EXPECT_EQ(source->rig().camera.width, 324);
    ASSERT_EQ(source->ground_truth().size(), 3U) << "nobody knows the pose of one";
    EXPECT_EQ(source->ground_truth()[2].T_w_c.translation().x(), 11);
    std::vector<std::int64_t> times;
    for (Frame frame; source->next(frame) == FrameStatus::kFrame;) {
      times.push_back(std::llround(static_cast<double>(frame.t_ns) * 30e-9));
      ASSERT_EQ(frame.depth.size(), cv::Size(324, 242)) << "drawn as the colour camera would have it";
      EXPECT_NEAR(frame.depth.at<std::uint16_t>(121, 162), 2000, 12);
    }
    EXPECT_EQ(times, (std::vector<std::int64_t>{0, 9, 10, 11}));
  }
  EXPECT_EQ(open_source(folder / "scene0", {.calibration = {}, .left_only = true})->frame_count(), 4);
}

TEST(PublicDatasets, ScanNetThatDoesNotFitItsMatrices) {
  const ScratchFolder folder;
  const std::string path = folder / "scene0";
  write_scannet(folder);
  folder.write("scene0/intrinsic/intrinsic_color.txt", matrix_of(1170, 648, 484));
  EXPECT_IO_ERROR(
      open_source(path),
      "intrinsic_color.txt: is of images about 1296x968 large, but they are 324x242: give --calib");
  for (const std::string damaged : {"1 2 3\n", "a 0 0 0 b 0 0 0 1\n", ""}) {
    folder.write("scene0/intrinsic/intrinsic_color.txt", damaged);
    EXPECT_IO_ERROR(open_source(path), "intrinsic_color.txt");
  }
  folder.write("scene0/intrinsic/intrinsic_color.txt", matrix_of(290, 162, 121));
  folder.write("scene0/intrinsic/extrinsic_depth.txt", "1 0 0 0.1\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  EXPECT_IO_ERROR(open_source(path), "extrinsic_depth.txt: is not the unit matrix");
}

}  // namespace
}  // namespace twofold
