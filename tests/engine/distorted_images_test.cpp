// Images of a pair whose lenses are of the rational model, recorded as the cameras took them.
#include <gtest/gtest.h>

#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "camera/rectifier.hpp"
#include "io/files/calibration_file.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/recorder.hpp"
#include "tests/engine/whole_run.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

using synthetic::SyntheticOptions;
using synthetic::SyntheticSequence;

/// More than the cameras see, and finer.
SyntheticOptions wide_courtyard() {
  SyntheticOptions scene;
  scene.scene = "courtyard";
  scene.width = 960;
  scene.height = 720;
  scene.f = 390;
  scene.frames = 120;
  scene.fps = 15;
  scene.noise = 2;
  return scene;
}

/// Two wide webcams, the right one turned a little against the left one. Their images reach to 37 degrees at
/// the sides, where the lenses draw them in by 15 %.
Calibration webcams(double baseline) {
  Calibration c;
  c.left = {{250, 250.5, 161, 118, 320, 240},
            {DistortionModel::kRational, {0.2, 0.05, 0.0005, -0.0003, 0.001, 0.5, 0.15, 0.01}}};
  c.right = {{251, 251, 157, 121, 320, 240},
             {DistortionModel::kRational, {0.21, 0.04, -0.0004, 0.0002, 0.002, 0.51, 0.14, 0.012}}};
  c.T_right_left = SE3(SO3::exp({0.01, -0.015, 0.02}), Vector3::Zero()) * SE3(SO3(), {-baseline, 0, 0});
  c.fps = 15;
  return c;
}

/// Takes a camera's image out of that of an ideal camera in the same place.
class CameraSampler {
 public:
  CameraSampler(const CameraModel& camera, const SO3& R_ideal_camera, const PinholeCamera& ideal)
      : x_(camera.pinhole.height, camera.pinhole.width, CV_32FC1), y_(x_.size(), CV_32FC1) {
    for (int v = 0; v < x_.rows; ++v) {
      for (int u = 0; u < x_.cols; ++u) {
        const auto ray = camera.unproject(Vector2(u, v));
        const Vector2 uv = ray ? ideal.project(R_ideal_camera * *ray) : Vector2(-1, -1);
        EXPECT_TRUE(ideal.contains(uv)) << u << ", " << v;
        x_.at<float>(v, u) = static_cast<float>(uv.x());
        y_.at<float>(v, u) = static_cast<float>(uv.y());
      }
    }
  }

  [[nodiscard]] cv::Mat see(const cv::Mat& ideal) const {
    cv::Mat image;
    cv::remap(ideal, image, x_, y_, cv::INTER_LINEAR);
    return image;
  }

 private:
  cv::Mat x_, y_;
};

struct Walk {
  std::size_t tracked = 0;
  double ate = 1e9;  ///< [m]
};

Walk walk(const Rig& rig, const FrameFeed& frames, const SyntheticSequence& sequence, const char* name) {
  const auto [result, path] = testing::run_whole(rig, frames);
  const auto evaluation = evaluate(associate(path, testing::true_path(sequence), 1'000'000), {});
  Walk walk{path.size(), evaluation ? evaluation->absolute.rmse : 1e9};
  std::printf("%s: %zu of %d frames, ATE %.4f m\n", name, walk.tracked, sequence.frame_count(), walk.ate);
  return walk;
}

class DistortedImages : public ::testing::Test {
 protected:
  DistortedImages()
      : sequence_(wide_courtyard()),
        calibration_(webcams(sequence_.rig().baseline)),
        left_(calibration_.left, SO3(), sequence_.rig().camera),
        right_(calibration_.right, calibration_.T_right_left.so3().inverse(), sequence_.rig().camera) {
    Recorder recorder(scratch_.path() / "r", SensorKind::kStereo, calibration_);
    for (int i = 0; i < sequence_.frame_count(); ++i) {
      ideal_.push_back(sequence_.render(i));
      Frame raw{ideal_[i].index, ideal_[i].t_ns, left_.see(ideal_[i].left), right_.see(ideal_[i].right), {}};
      EXPECT_TRUE(recorder.offer(raw, true));
    }
    EXPECT_EQ(recorder.finish(), "");
  }

  /// What cameras without lenses would have seen that are as the rectified ones.
  [[nodiscard]] Walk without_lenses() const {
    const Rectifier rectifier(calibration_);
    const CameraSampler pinhole({rectifier.rig().camera, {}}, rectifier.R_rectified_left().inverse(),
                                sequence_.rig().camera);
    const FrameFeed frames = [&, next = std::size_t{0}](Frame& frame) mutable {
      if (next == ideal_.size()) return FrameStatus::kEnd;
      frame = ideal_[next++];
      frame.left = pinhole.see(frame.left);
      frame.right = pinhole.see(frame.right);
      return FrameStatus::kFrame;
    };
    return walk(rectifier.rig(), frames, sequence_, "without lenses");
  }

  ScratchFolder scratch_;
  SyntheticSequence sequence_;
  Calibration calibration_;
  CameraSampler left_, right_;
  std::vector<Frame> ideal_;
};

TEST_F(DistortedImages, AreTrackedAsWellAsThoseWithoutLenses) {
  const Walk ideal = without_lenses();
  const auto source = open_source("euroc:" + (scratch_ / "r"));
  EXPECT_NEAR(source->rig().baseline, sequence_.rig().baseline, 1e-9);
  const Walk distorted = walk(source->rig(), testing::frames_of(*source), sequence_, "with them");
  EXPECT_EQ(ideal.tracked, ideal_.size());
  EXPECT_EQ(distorted.tracked, ideal_.size());
  EXPECT_LT(distorted.ate, 1.5 * ideal.ate);

  Calibration ignorant = calibration_;
  ignorant.left.distortion = ignorant.right.distortion = {};
  write_calibration(scratch_.path() / "pinholes.yaml", ignorant, {});
  SourceOptions options;
  options.calibration = scratch_.path() / "pinholes.yaml";
  const auto pinholes = open_source("euroc:" + (scratch_ / "r"), options);
  const Walk bent =
      walk(pinholes->rig(), testing::frames_of(*pinholes), sequence_, "lenses left out of account");
  EXPECT_GT(bent.ate, 20 * ideal.ate) << "or this test says nothing";
}

}  // namespace
}  // namespace twofold
