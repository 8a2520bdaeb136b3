#include <fmt/format.h>

#include "io/sources/open_source.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr int kSequenceLength = 4;

/// The colour cameras beside the grey ones; the left one 6 cm to their left, 2 cm lower, 1 cm behind.
constexpr const char* kFourCameras =
    "P0: 50 0 32 0 0 50 24 0 0 0 1 0\nP1: 50 0 32 -10 0 50 24 0 0 0 1 0\n"
    "P2: 50 0 32 3.32 0 50 24 -0.76 0 0 1 0.01\nP3: 50 0 32 -6.68 0 50 24 -0.76 0 0 1 0.01\n"
    "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n";

std::string poses_text(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += fmt::format("0 0 1 {} 0 1 0 0 -1 0 0 0\n", i);
  return text;
}

/// One sequence as the benchmark's archives unpack: DATASET/sequences/06, and its poses in DATASET/poses.
void write_dataset(const ScratchFolder& folder, bool colour) {
  std::string times;
  for (int i = 0; i < kSequenceLength; ++i) {
    for (const int right : {0, 1}) {
      const std::string name = fmt::format("sequences/06/image_{}/{:06d}.png", (colour ? 2 : 0) + right, i);
      cv::Mat image = numbered_image(64, 48, 100 * right + i, colour ? CV_8UC3 : CV_8UC1);
      if (colour) image.row(20).setTo(cv::Scalar(10, 20, 200));
      folder.write_image(name, image);
    }
    times += fmt::format("{:e}\n", 0.1 * i);
  }
  folder.write("sequences/06/times.txt", times);
  folder.write("sequences/06/calib.txt", kFourCameras);
  folder.write("poses/06.txt", poses_text(kSequenceLength));
}

TEST(KittiLayout, TruthLiesBesideTheSequences) {
  const ScratchFolder folder;
  write_dataset(folder, false);
  for (const std::string sequence : {"sequences/06", "sequences/06/", "poses/../sequences/06"}) {
    const auto source = open_source(folder / sequence);
    ASSERT_EQ(source->ground_truth().size(), std::size_t{kSequenceLength}) << sequence;
    EXPECT_EQ(source->ground_truth()[2].t_ns, 200'000'000);
    EXPECT_EQ(source->ground_truth()[2].T_w_c.translation(), Vector3(2, 0, 0));
  }
  folder.write("sequences/06/poses.txt", "1 0 0 7 0 1 0 0 0 0 1 0\n" + poses_text(kSequenceLength - 1));
  EXPECT_EQ(open_source(folder / "sequences/06")->ground_truth()[0].T_w_c.translation().x(), 7)
      << "poses.txt in the folder itself goes first";
}

TEST(KittiLayout, OtherFoldersOfThatNameAreNotAsked) {
  const ScratchFolder folder;
  write_dataset(folder, false);
  fs::rename(folder.path() / "sequences", folder.path() / "mine");
  const auto source = open_source(folder / "mine/06");
  EXPECT_TRUE(source->ground_truth().empty());
  EXPECT_TRUE(source->report().notes.empty());
}

TEST(KittiLayout, ColourAlone) {
  const ScratchFolder folder;
  write_dataset(folder, true);
  for (const std::string scheme : {"", "kitti:"}) {
    const auto source = open_source(scheme + (folder / "sequences/06"));
    EXPECT_EQ(source->rig().kind, SensorKind::kStereo);
    EXPECT_NEAR(source->rig().baseline, 0.2, 1e-12);
    Frame frame;
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.left.type(), CV_8UC1);
    EXPECT_EQ(frame.right.at<unsigned char>(0, 5), 100);
    const cv::Mat colour = source->colour_image(0);
    ASSERT_EQ(colour.type(), CV_8UC3);
    EXPECT_EQ(colour.at<cv::Vec3b>(20, 40), cv::Vec3b(10, 20, 200));
    // Poses are the grey camera's, whose x axis is the world's -z, and z the world's x.
    ASSERT_EQ(source->ground_truth().size(), std::size_t{kSequenceLength});
    EXPECT_LT((source->ground_truth()[1].T_w_c.translation() - Vector3(1 - 0.01, 0.02, 0.06)).norm(), 1e-12);
  }
}

TEST(KittiLayout, GreyWhereBothAreThere) {
  const ScratchFolder folder;
  write_dataset(folder, true);
  write_dataset(folder, false);
  const auto source = open_source(folder / "sequences/06");
  EXPECT_TRUE(source->colour_image(0).empty());
  EXPECT_EQ(source->ground_truth()[1].T_w_c.translation(), Vector3(1, 0, 0));
}

TEST(KittiLayout, ColourCamerasOffTheRowAreRectified) {
  const ScratchFolder folder;
  write_dataset(folder, true);
  folder.write("sequences/06/calib.txt",
               "P0: 50 0 32 0 0 50 24 0 0 0 1 0\nP2: 50 0 32 3 0 50 24 0 0 0 1 0\n"
               "P3: 50 0 32 -7 0 50 24 0.5 0 0 1 0\n");  // 1 cm higher
  const auto source = open_source(folder / "sequences/06");
  EXPECT_NEAR(source->rig().baseline, std::hypot(0.2, 0.01), 1e-12);
  EXPECT_NEAR(source->R_rectified_raw().log().norm(), std::atan(0.01 / 0.2), 1e-9);
  folder.write("sequences/06/calib.txt", "P0: 50 0 32 0 0 50 24 0 0 0 1 0\n");
  EXPECT_IO_ERROR(open_source(folder / "sequences/06"), "calib.txt: key 'P2' is missing");
}

std::vector<std::int64_t> numbers_of_frames(FrameSource& source) {
  std::vector<std::int64_t> numbers;
  for (Frame frame; source.next(frame) == FrameStatus::kFrame;) numbers.push_back(frame.index);
  return numbers;
}

/// As after a download that missed some files; times.txt and the poses are those of the whole.
TEST(KittiLayout, AnImageThatIsMissingIsAGap) {
  const ScratchFolder folder;
  write_dataset(folder, false);
  fs::remove(folder.path() / "sequences/06/image_1/000001.png");
  fs::remove(folder.path() / "sequences/06/image_0/000002.png");
  const auto source = open_source(folder / "sequences/06");
  EXPECT_EQ(numbers_of_frames(*source), (std::vector<std::int64_t>{0, 3})) << source->error();
  EXPECT_EQ(source->ground_truth().size(), std::size_t{kSequenceLength});
  const SourceReport report = source->report();
  ASSERT_EQ(report.faults.size(), 2U);
  EXPECT_EQ(report.faults[0],
            (folder / "sequences/06/image_1/000001.png") + ": no such image file; its frame is left out");
  EXPECT_EQ(report.faults[1],
            (folder / "sequences/06/image_0/000002.png") + ": no such image file; its frame is left out");
}

TEST(KittiLayout, ImagesOfOtherNamesAreNoPairs) {
  const ScratchFolder folder;
  write_dataset(folder, false);
  for (int i = 1; i < kSequenceLength; ++i) {
    const fs::path right = folder.path() / "sequences/06/image_1";
    fs::rename(right / fmt::format("{:06d}.png", i), right / fmt::format("r{}.png", i));
  }
  EXPECT_IO_ERROR(open_source(folder / "sequences/06"),
                  "06: of 4 images in image_0 and 4 in image_1 only 1 have the same name");
}

TEST(KittiLayout, PosesOfOtherImagesAreLeftOut) {
  const ScratchFolder folder;
  write_dataset(folder, false);
  folder.write("poses/06.txt", poses_text(kSequenceLength + 1));
  const auto source = open_source(folder / "sequences/06");
  EXPECT_TRUE(source->ground_truth().empty());
  ASSERT_EQ(source->report().notes.size(), 1U);
  EXPECT_NE(source->report().notes[0].find("06.txt: has 5 poses for 4 images; the ground truth is left out"),
            std::string::npos)
      << source->report().notes[0];
}

}  // namespace
}  // namespace twofold
