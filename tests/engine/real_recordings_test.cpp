// The whole engine on real recordings, as it comes: every frame with a pose, and errors that have not grown
// by more than a third. On fr1_rpy, newtsukuba and mh01's left images the bounds are the errors of ORB-SLAM3.
// TWOFOLD_DATA names the folder.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <string>

#include "io/sources/open_source.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "tests/engine/whole_run.hpp"

namespace twofold {
namespace {

struct Recording {
  const char* name;
  const char* scheme;
  const char* folder;  ///< in TWOFOLD_DATA, with parameters
  int tracked;         ///< frames, at least
  double ate;          ///< [m], at most; of one camera after alignment with scale
  bool one_camera;
};

std::ostream& operator<<(std::ostream& out, const Recording& recording) {
  return out << recording.name;
}

class RealRecording : public ::testing::TestWithParam<Recording> {};

TEST_P(RealRecording, IsTrackedAsWellAsBefore) {
  const char* data = std::getenv("TWOFOLD_DATA");
  if (data == nullptr) GTEST_SKIP() << "TWOFOLD_DATA is not set";
  const Recording& recording = GetParam();
  SourceOptions source_options;
  source_options.left_only = recording.one_camera;
  const auto source =
      open_source(std::string(recording.scheme) + ":" + data + "/" + recording.folder, source_options);
  EngineOptions options;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  const auto [result, path] = testing::run_whole(source->rig(), testing::frames_of(*source), options);
  EXPECT_GE(static_cast<int>(path.size()), recording.tracked);
  const auto evaluation = evaluate(associate(path, source->ground_truth(), 20'000'000),
                                   {.alignment = recording.one_camera ? Alignment::kSim3 : Alignment::kSe3});
  ASSERT_TRUE(evaluation);
  EXPECT_LT(evaluation->absolute.rmse, recording.ate);
  RecordProperty("ate_mm", std::to_string(1e3 * evaluation->absolute.rmse));
}

INSTANTIATE_TEST_SUITE_P(
    All, RealRecording,
    ::testing::Values(
        Recording{"kitti06", "kitti", "stereo_kitti06_51", 51, 0.039, false},
        Recording{"mh01", "euroc", "stereo_euroc_mh01_300", 300, 0.0046, false},
        Recording{"redkitchen", "tum", "rgbd_7scenes_redkitchen_334", 334, 0.048, false},
        // Neither the lens nor the readout are given: the latter is found.
        Recording{
            "fr1_rpy", "tum",
            "rgbd_tum_fr1_rpy_200?fx=517.306408&fy=516.469215&cx=318.643040&cy=255.313989&depth_scale=5000",
            200, 0.0246, false},
        Recording{"newtsukuba", "kitti", "mono_newtsukuba_150", 150, 0.0047, true},
        Recording{"mh01_left", "euroc", "stereo_euroc_mh01_300", 300, 0.0049, true}),
    [](const auto& test) { return std::string(test.param.name); });

struct Seldom {
  int every;
  double tracked;  ///< share of all frames, at least
  double ate;      ///< [m], at most, mean over the runs
  double worst;    ///< [m], at most, of each
};

/// Every so many-th frame of fr1_rpy, a depth camera that turns by 65 degrees a second, from each of the
/// first ones on. Blurred frames are lost then, and surfaces alone place the next ones, as they look from
/// where the camera was or from elsewhere. One run says little: errors of a few frames that hardly show
/// anything differ.
class SeldomFrames : public ::testing::TestWithParam<Seldom> {
 protected:
  static SourceOptions with_lens(int every) {
    const auto lens =
        std::filesystem::path(::testing::TempDir()) / ("lens_" + std::to_string(every) + ".yaml");
    std::ofstream(lens)
        << "sensor: rgbd\n"
           "cameras:\n"
           "  - {size: [640, 480], intrinsics: [517.306408, 516.469215, 318.64304, 255.313989],\n"
           "     distortion: {model: radtan, coefficients: [0.262383, -0.953104, -0.005358, "
           "0.002628, 1.163314]}}\n"
           "depth: {unit: 0.0002}\n";
    SourceOptions options;
    options.calibration = lens;
    return options;
  }
  static FrameFeed seldom(FrameSource& source, int every, int first) {
    return [&source, every, next = every - first](Frame& frame) mutable {
      while (source.next(frame) == FrameStatus::kFrame)
        if (next++ % every == 0) return FrameStatus::kFrame;
      return FrameStatus::kEnd;
    };
  }
};

TEST_P(SeldomFrames, OfATurningCameraAreNotPlacedWhereTheMapsPointsAreNotSeen) {
  const char* data = std::getenv("TWOFOLD_DATA");
  if (data == nullptr) GTEST_SKIP() << "TWOFOLD_DATA is not set";
  const int every = GetParam().every;
  EngineOptions options;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  double frames = 0, tracked = 0, sum = 0;
  for (int first = 0; first < every; ++first) {
    SCOPED_TRACE("from frame " + std::to_string(first));
    const auto source = open_source("tum:" + std::string(data) + "/rgbd_tum_fr1_rpy_200", with_lens(every));
    const auto [result, path] = testing::run_whole(source->rig(), seldom(*source, every, first), options);
    const auto evaluation = evaluate(associate(path, source->ground_truth(), 20'000'000), {});
    ASSERT_TRUE(evaluation);
    EXPECT_LT(evaluation->absolute.rmse, GetParam().worst);
    frames += static_cast<double>(result.frames.size());
    tracked += static_cast<double>(path.size());
    sum += evaluation->absolute.rmse;
  }
  EXPECT_GE(tracked, GetParam().tracked * frames);
  EXPECT_LT(sum / every, GetParam().ate);
}

// 0.031 and 0.043 m. With two starts for nearly each frame 0.042 and 0.066 m, one run at 0.21; at 0.21 and
// 0.11 was the first run of each when poses were believed where the map's points are not seen.
INSTANTIATE_TEST_SUITE_P(All, SeldomFrames,
                         ::testing::Values(Seldom{4, 0.95, 0.04, 0.06}, Seldom{6, 0.78, 0.06, 0.07}),
                         [](const auto& test) { return "Every" + std::to_string(test.param.every); });

/// Seven black frames of a car at 12 m/s: two parts of the map, and ten more frames lost, when it was looked
/// for only where it had been.
TEST(BlackFrames, OfACarLeaveOneMap) {
  const char* data = std::getenv("TWOFOLD_DATA");
  if (data == nullptr) GTEST_SKIP() << "TWOFOLD_DATA is not set";
  const auto source = open_source("kitti:" + std::string(data) + "/stereo_kitti06_51", {});
  const FrameFeed feed = [&source](Frame& frame) {
    if (source->next(frame) != FrameStatus::kFrame) return FrameStatus::kEnd;
    if (frame.index >= 20 && frame.index < 27)
      frame.left = frame.right = cv::Mat::zeros(frame.left.size(), CV_8UC1);
    return FrameStatus::kFrame;
  };
  const auto [result, path] = testing::run_whole(source->rig(), feed);
  int parts = 0;
  for (const FrameRecord& record : result.frames) {
    if (has_final_pose(record))
      parts = std::max(parts, static_cast<int>(index(result.graph.part(record.reference))));
  }
  EXPECT_EQ(parts, 0);
  EXPECT_GE(path.size(), 42U);
  const auto evaluation = evaluate(associate(path, source->ground_truth(), 20'000'000), {});
  ASSERT_TRUE(evaluation);
  EXPECT_LT(evaluation->absolute.rmse, 0.039);
}

}  // namespace
}  // namespace twofold
