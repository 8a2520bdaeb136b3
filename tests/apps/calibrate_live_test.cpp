// `twofold calibrate` from a camera, played by a driver behind the system calls: a person who does what the
// program says is through after a few dozen views; one who does not is told why there is no calibration.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "apps/twofold/calibration/calibration_session.hpp"
#include "fixtures/fake_device.hpp"
#include "io/files/calibration_file.hpp"
#include "io/sources/v4l2_source.hpp"
#include "tests/apps/calibrating_person.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

using namespace twofold::testing;

FakeFrame grey(const cv::Mat& image) {
  FakeFrame frame;
  frame.bytes.assign(image.datastart, image.dataend);
  return frame;
}

void set_up(FakeV4l2::Device& device, int width, std::function<FakeFrame(std::uint64_t)> frame) {
  device.width = static_cast<std::uint32_t>(width);
  device.height = kHeight;
  device.buffer_bytes = static_cast<std::uint32_t>(width * kHeight);
  device.frame = std::move(frame);
}

class CalibrateLive : public ::testing::Test {
 protected:
  struct Outcome {
    std::string text, refusal;
    std::vector<std::string> said;
  };

  /// Runs the command's session until it ends by itself or `frames` have come: Ctrl-C.
  Outcome calibrate(const std::string& spec, std::function<void(const std::string&)> listener = {}) {
    SourceOptions options;
    options.raw = true;
    options.stop = &stop_;
    V4l2Source source(parse_source_spec(spec), options, std::move(driver_));
    Outcome outcome;
    const auto say = [&](const std::string& line) {
      outcome.said.push_back(line);
      if (listener) listener(line);
    };
    const CalibrationRequest request{"chessboard:9x6:0.025", 20, file(), folder_ / "plot.png"};
    try {
      outcome.text = calibrate_from(source, request, stop_, say);
    } catch (const std::exception& e) {
      outcome.refusal = e.what();
    }
    return outcome;
  }

  [[nodiscard]] std::string file() const { return folder_ / "camera.yaml"; }
  /// Ctrl-C when the camera gives its `frames`-th frame.
  void interrupt_at(std::uint64_t frames, std::uint64_t k) {
    if (k >= frames) stop_ = true;
  }

  ScratchFolder folder_;
  std::atomic<bool> stop_{false};
  std::unique_ptr<FakeV4l2> driver_ = std::make_unique<FakeV4l2>();
};

bool any_says(const std::vector<std::string>& said, const std::string& part) {
  return std::any_of(said.begin(), said.end(),
                     [&](const std::string& line) { return line.find(part) != std::string::npos; });
}

std::string all(const std::vector<std::string>& said) {
  std::string text;
  for (const std::string& line : said) text += line + "\n";
  return text;
}

TEST_F(CalibrateLive, WhoDoesWhatItSaysGetsAGoodCalibrationOfOneCamera) {
  ObedientPerson person;
  Scene scene(left_camera(), SE3(), [&](std::uint64_t) { return person.next().T_l_b(); });
  set_up(driver_->devices["/dev/video0"], kWidth, [&](std::uint64_t k) {
    interrupt_at(150 * Scene::kFramesAHold, k);
    return grey(scene.image(k));
  });
  const Outcome outcome = calibrate("v4l2:/dev/video0", [&](const std::string& line) { person.hear(line); });
  ASSERT_EQ(outcome.refusal, "") << all(outcome.said);
  EXPECT_FALSE(stop_) << "not complete after 150 views; last: " << outcome.said.back();
  EXPECT_TRUE(any_says(outcome.said, "show the board in the")) << "coverage";
  EXPECT_TRUE(any_says(outcome.said, "tilt its")) << "tilt";
  EXPECT_TRUE(any_says(outcome.said, "hold it")) << "distance";
  EXPECT_TRUE(any_says(outcome.said, "complete"));
  const Calibration found = read_calibration(file());
  EXPECT_EQ(found.kind, SensorKind::kMono);
  EXPECT_NEAR(found.left.pinhole.fx / kLeft.pinhole.fx, 1, 0.002);
  EXPECT_NEAR(found.left.pinhole.fy / kLeft.pinhole.fy, 1, 0.002);
  EXPECT_FALSE(cv::imread(folder_ / "plot.png").empty());
}

TEST_F(CalibrateLive, TwoCamerasAreCalibratedTogether) {
  ObedientPerson person;
  std::vector<SE3> holds;  // the same for both cameras, whichever is asked first
  const auto holder = [&](std::uint64_t hold) {
    while (holds.size() <= hold) holds.push_back(person.next().T_l_b());
    return holds[hold];
  };
  Scene left(left_camera(), SE3(), holder), right(right_camera(), kT_right_left, holder);
  const auto add = [&](const std::string& path, Scene& scene) {
    set_up(driver_->devices[path], kWidth, [&](std::uint64_t k) {
      interrupt_at(150 * Scene::kFramesAHold, k);
      return grey(scene.image(k));
    });
  };
  add("/dev/video0", left);
  add("/dev/video2", right);
  const Outcome outcome =
      calibrate("v4l2:/dev/video0?right=/dev/video2", [&](const std::string& line) { person.hear(line); });
  ASSERT_EQ(outcome.refusal, "") << all(outcome.said);
  EXPECT_FALSE(stop_) << outcome.said.back();
  const Calibration found = read_calibration(file());
  EXPECT_EQ(found.kind, SensorKind::kStereo);
  EXPECT_NEAR(found.T_right_left.translation().norm() / kT_right_left.translation().norm(), 1, 0.005);
  EXPECT_NEAR(found.left.pinhole.fx / kLeft.pinhole.fx, 1, 0.002);
  EXPECT_NEAR(found.right.pinhole.fx / kRight.pinhole.fx, 1, 0.002);
}

TEST_F(CalibrateLive, BothImagesInOneStreamAreAPair) {
  ObedientPerson person;
  std::vector<SE3> holds;
  const auto holder = [&](std::uint64_t hold) {
    while (holds.size() <= hold) holds.push_back(person.next().T_l_b());
    return holds[hold];
  };
  Scene left(left_camera(), SE3(), holder), right(right_camera(), kT_right_left, holder);
  set_up(driver_->devices["/dev/video0"], 2 * kWidth, [&](std::uint64_t k) {
    interrupt_at(14 * Scene::kFramesAHold, k);
    cv::Mat both;
    cv::hconcat(left.image(k), right.image(k), both);
    return grey(both);
  });
  // Interrupted early: what has been seen decides.
  const Outcome outcome =
      calibrate("v4l2:/dev/video0?layout=side-by-side", [&](const std::string& line) { person.hear(line); });
  EXPECT_TRUE(stop_);
  ASSERT_EQ(outcome.refusal, "") << outcome.said.back();
  EXPECT_EQ(read_calibration(file()).kind, SensorKind::kStereo);
}

TEST_F(CalibrateLive, ABoardThatIsNeverTiltedIsRefusedAndNothingWritten) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(-1, 1);
  Scene scene(left_camera(), SE3(), [&](std::uint64_t) {
    return Hold{1.1 * unit(random), 1.1 * unit(random), 0.4}.T_l_b();
  });
  set_up(driver_->devices["/dev/video0"], kWidth, [&](std::uint64_t k) {
    interrupt_at(40 * Scene::kFramesAHold, k);
    return grey(scene.image(k));
  });
  const Outcome outcome = calibrate("v4l2:/dev/video0");
  EXPECT_NE(outcome.refusal.find("no calibration: degenerate: the board has the same tilt"),
            std::string::npos)
      << outcome.refusal;
  EXPECT_TRUE(any_says(outcome.said, "tilt its")) << outcome.said.back();
  EXPECT_FALSE(std::filesystem::exists(file()));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "plot.png"));
}

TEST_F(CalibrateLive, WithoutABoardItSaysSo) {
  set_up(driver_->devices["/dev/video0"], kWidth, [&](std::uint64_t k) {
    interrupt_at(40, k);
    return grey(cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(90)));
  });
  const Outcome outcome = calibrate("v4l2:/dev/video0");
  EXPECT_TRUE(any_says(outcome.said, "The board is not seen"));
  EXPECT_NE(outcome.refusal.find("the board was never seen"), std::string::npos) << outcome.refusal;
}

TEST_F(CalibrateLive, ABoardThatIsWavedAboutIsNotTaken) {
  const cv::Mat print = print_chessboard(kBoard);
  set_up(driver_->devices["/dev/video0"], kWidth, [&](std::uint64_t k) {
    interrupt_at(40, k);
    std::mt19937 noise(static_cast<unsigned>(k));
    return grey(left_camera().see(print, kPrintSquarePx / kBoard.square,
                                  {2.0 * kPrintSquarePx, 2.0 * kPrintSquarePx},
                                  Hold{k % 2 == 0 ? -0.2 : 0.2, 0, 0.45}.T_l_b(), noise));
  });
  const Outcome outcome = calibrate("v4l2:/dev/video0");
  EXPECT_TRUE(any_says(outcome.said, "Hold the board still"));
  EXPECT_NE(outcome.refusal.find("too few views: 0"), std::string::npos) << outcome.refusal;
}

TEST_F(CalibrateLive, ALostCameraIsNamed) {
  FakeV4l2* driver = driver_.get();
  set_up(driver_->devices["/dev/video0"], kWidth, [&, driver](std::uint64_t k) {
    if (k == 3) driver->devices["/dev/video0"].absent_until_ns = driver->time_ns + 3'600'000'000'000;
    return grey(cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(90)));
  });
  const Outcome outcome = calibrate("v4l2:/dev/video0?reconnect_ms=500");
  EXPECT_NE(outcome.refusal.find("/dev/video0"), std::string::npos) << outcome.refusal;
  EXPECT_FALSE(std::filesystem::exists(file()));
}

}  // namespace
}  // namespace twofold
