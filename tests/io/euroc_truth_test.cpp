#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/sources/open_source.hpp"
#include "io/sources/recording.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// The camera looks along the body's y axis, and rectification turns it.
SE3 T_b_c(int camera) {
  return {SO3::exp(Vector3(-1.5, 0.1, 0.2 + 0.05 * camera)), Vector3(0.3 + 0.2 * camera, -0.1, 0.05)};
}

SE3 T_w_b(int i) {
  return {SO3::exp(Vector3(0.1 * i, 0, 0.3 * i)), Vector3(i, 2, 0.5 * i)};
}

std::string numbers(const SE3& T) {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = T.matrix();
  return fmt::format("[{:.17g}]", fmt::join(rows.data(), rows.data() + 16, ", "));
}

constexpr const char* kEurocLens =
    "resolution: [64, 48]\ncamera_model: pinhole\nintrinsics: [50, 50, 32, 24]\n";

constexpr int kTruePoses = 3;

void write_images(const ScratchFolder& folder) {
  for (const char* camera : {"cam0", "cam1"}) {
    std::string list = "#timestamp [ns],filename\n";
    for (int i = 0; i < kTruePoses; ++i) {
      folder.write_image(fmt::format("mav0/{}/data/{}.png", camera, i), numbered_image(64, 48, i));
      list += fmt::format("{},{}.png\n", 1000 + i, i);
    }
    folder.write(fmt::format("mav0/{}/data.csv", camera), list);
  }
}

void write_sensors(const ScratchFolder& folder) {
  for (int c = 0; c < 2; ++c) {
    folder.write(fmt::format("mav0/cam{}/sensor.yaml", c),
                 fmt::format("T_BS:\n  data: {}\n{}", numbers(T_b_c(c)), kEurocLens));
  }
}

fs::path write_truth(const ScratchFolder& folder, const std::string& sensor) {
  std::string text = "#timestamp [ns], p_RS_R_x [m], ...\n";
  for (int i = 0; i < kTruePoses; ++i) {
    const Eigen::Quaterniond q = T_w_b(i).so3().quaternion();
    const Vector3 t = T_w_b(i).translation();
    text += fmt::format("{},{},{},{},{:.12f},{:.12f},{:.12f},{:.12f}\n", 1000 + i, t.x(), t.y(), t.z(), q.w(),
                        q.x(), q.y(), q.z());
  }
  return folder.write("mav0/" + sensor + "/data.csv", text);
}

std::string indented(const std::string& lines) {
  std::string text = "  " + lines;
  for (std::size_t at = text.find('\n'); at + 1 < text.size(); at = text.find('\n', at + 3))
    text.insert(at + 1, "  ");
  return text;
}

/// As Kalibr writes it; extrinsics of the IMU on request.
fs::path write_camchain(const ScratchFolder& folder, bool with_imu) {
  const std::string imu = with_imu ? fmt::format("T_cam_imu: {}\n", numbers(T_b_c(0).inverse())) : "";
  const SE3 T_right_left = T_b_c(1).inverse() * T_b_c(0);
  return folder.write(
      "camchain.yaml",
      fmt::format("cam0:\n{}cam1:\n{}", indented(imu + kEurocLens),
                  indented(fmt::format("T_cn_cnm1: {}\n{}", numbers(T_right_left), kEurocLens))));
}

void expect_poses_of_camera(const Trajectory& truth, const SO3& R_rectified_raw) {
  ASSERT_GT(R_rectified_raw.log().norm(), 0.1);
  ASSERT_EQ(truth.size(), std::size_t{kTruePoses});
  const SE3 T_raw_rectified(R_rectified_raw.inverse(), Vector3::Zero());
  for (int i = 0; i < kTruePoses; ++i) {
    const SE3 expected = T_w_b(i) * T_b_c(0) * T_raw_rectified;
    EXPECT_LT((truth[static_cast<std::size_t>(i)].T_w_c.matrix() - expected.matrix()).norm(), 1e-9) << i;
  }
}

TEST(EurocTruth, AFileByItselfIsWhatTheSourceHas) {
  const ScratchFolder folder;
  write_images(folder);
  write_sensors(folder);
  const fs::path file = write_truth(folder, "state_groundtruth_estimate0");
  const auto source = open_source(folder.path().string());
  expect_poses_of_camera(source->ground_truth(), source->R_rectified_raw());
  const auto truth = read_euroc_truth_of_camera(file);
  ASSERT_TRUE(truth);
  ASSERT_EQ(truth->size(), source->ground_truth().size());
  for (std::size_t i = 0; i < truth->size(); ++i)
    EXPECT_EQ((*truth)[i].T_w_c.matrix(), source->ground_truth()[i].T_w_c.matrix());
}

TEST(EurocTruth, OfAFileThatLiesAloneNothingIsKnown) {
  const ScratchFolder folder;
  EXPECT_FALSE(read_euroc_truth_of_camera(write_truth(folder, "state_groundtruth_estimate0")));
  folder.write("mav0/cam0/sensor.yaml", kEurocLens);  // and no T_BS
  EXPECT_FALSE(read_euroc_truth_of_camera(write_truth(folder, "state_groundtruth_estimate0")));
}

TEST(EurocTruth, MotionCaptureOfTumVi) {
  const ScratchFolder folder;
  write_images(folder);
  write_sensors(folder);
  write_truth(folder, "mocap0");
  const auto source = open_source(folder.path().string());
  expect_poses_of_camera(source->ground_truth(), source->R_rectified_raw());
}

TEST(EurocTruth, KalibrSaysWhereTheCameraSitsInTheBody) {
  const ScratchFolder folder;
  write_images(folder);
  write_truth(folder, "mocap0");
  const auto source = open_source(folder.path().string(), {.calibration = write_camchain(folder, true)});
  expect_poses_of_camera(source->ground_truth(), source->R_rectified_raw());
  EXPECT_TRUE(source->report().notes.empty());
}

TEST(EurocTruth, PosesOfTheBodyAreNotTakenForTheCameras) {
  const ScratchFolder folder;
  write_images(folder);
  write_truth(folder, "state_groundtruth_estimate0");
  const SourceOptions options{.calibration = write_camchain(folder, false)};
  const auto source = open_source(folder.path().string(), options);
  EXPECT_TRUE(source->ground_truth().empty());
  ASSERT_EQ(source->report().notes.size(), 1U);
  EXPECT_NE(source->report().notes[0].find("data.csv: its poses are the body's"), std::string::npos);
  SourceOptions preloading = options;
  preloading.preload = true;
  EXPECT_EQ(open_source(folder.path().string(), preloading)->report().notes, source->report().notes);
}

}  // namespace
}  // namespace twofold
