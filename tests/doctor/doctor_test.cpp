#include <algorithm>

#include <fmt/format.h>

#include "doctor/camera.hpp"
#include "doctor/depth_images.hpp"
#include "doctor/disk.hpp"
#include "doctor/machine.hpp"
#include "doctor/stereo_rows.hpp"
#include "fixtures/fake_device.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

const Finding& find(const std::vector<Finding>& findings, const std::string& subject) {
  const auto found = std::find_if(findings.begin(), findings.end(), [&](const Finding& f) {
    return f.subject.find(subject) != std::string::npos;
  });
  if (found == findings.end()) throw std::runtime_error("no finding about " + subject);
  return *found;
}

/// proc and sys of a machine that is fit in every way.
class Machine {
 public:
  Machine() {
    governor("performance");
    folder_.write("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n");
    folder_.write("proc/self/timerslack_ns", "50000\n");
    folder_.write("proc/loadavg", "0.20 0.1 0.1 1/100 4\n");
    cpuinfo("fpu sse4_2 popcnt avx2 fma bmi1 bmi2 f16c movbe avx512f avx512bw avx512vl fp asimd");
    status("0-3", "0000000000000000");
    limits("50", "unlimited");
  }
  void governor(const std::string& name) {
    for (int cpu = 0; cpu < 4; ++cpu)
      folder_.write(fmt::format("sys/devices/system/cpu/cpu{}/cpufreq/scaling_governor", cpu), name + "\n");
  }
  /// As x86 calls them, and as ARM does.
  void cpuinfo(const std::string& flags) {
    folder_.write("proc/cpuinfo", "processor\t: 0\nflags\t\t: " + flags + "\nFeatures\t: " + flags + "\n");
  }
  void status(const std::string& cpus, const std::string& capabilities) {
    folder_.write("proc/self/status",
                  "Name:\tx\nCapEff:\t" + capabilities + "\nCpus_allowed_list:\t" + cpus + "\n");
  }
  void limits(const std::string& priority, const std::string& locked) {
    folder_.write("proc/self/limits",
                  "Limit                     Soft Limit           Hard Limit           Units\n"
                  "Max locked memory         " +
                      locked + "              " + locked +
                      "  bytes\n"
                      "Max realtime priority     " +
                      priority + "                    0\n");
  }
  [[nodiscard]] const ScratchFolder& folder() const { return folder_; }
  [[nodiscard]] std::vector<Finding> check() const { return check_machine(folder_.path()); }

 private:
  ScratchFolder folder_;
};

TEST(Doctor, FindsNothingWrongWithAFitMachine) {
  for (const Finding& finding : Machine().check()) {
    EXPECT_EQ(finding.health, Health::kOk) << finding.subject << ": " << finding.state;
    EXPECT_EQ(finding.remedy, "");
  }
}

TEST(Doctor, NamesEveryFaultWithItsRemedy) {
  Machine machine;
  machine.governor("powersave");
  machine.folder().write("sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet\n");
  machine.folder().write("proc/self/timerslack_ns", "5000000\n");
  machine.folder().write("proc/loadavg", "7.9 5 5 1/100 4\n");
  machine.status("2", "0000000000000000");
  machine.limits("0", "65536");
  const auto findings = machine.check();
  for (const auto& [subject, state] : {std::pair{"governor", "powersave (4)"},
                                       {"clock source", "hpet"},
                                       {"timer slack", "5000 us"},
                                       {"load", "7.9 on 1"},
                                       {"cores", "1 for this process"},
                                       {"SCHED_FIFO", "not permitted"},
                                       {"locked memory", "64 kB"}}) {
    const Finding& finding = find(findings, subject);
    EXPECT_EQ(finding.health, Health::kWarn) << subject;
    EXPECT_NE(finding.state.find(state), std::string::npos) << finding.state;
    EXPECT_NE(finding.remedy, "") << subject;
  }
}

TEST(Doctor, CapabilitiesStandInForLimits) {
  Machine machine;
  machine.limits("0", "65536");
  machine.status("0-3", "0000000000804000");  // bits 14 and 23
  EXPECT_EQ(find(machine.check(), "SCHED_FIFO").health, Health::kOk);
  EXPECT_EQ(find(machine.check(), "locked memory").health, Health::kOk);
}

TEST(Doctor, MissingInstructionsAreBad) {
  Machine machine;
  machine.cpuinfo("fpu");
  const Finding finding = find(machine.check(), "processor");
  EXPECT_EQ(finding.health, Health::kBad);
  const bool arm = std::string(TWOFOLD_ARCH).starts_with("armv8");
  EXPECT_NE(finding.state.find(arm ? "asimd" : "popcnt"), std::string::npos);
}

TEST(Doctor, AnEmptyTreeIsSurvived) {
  const ScratchFolder folder;
  for (const Finding& finding : check_machine(folder.path())) EXPECT_NE(finding.health, Health::kBad);
}

TEST(Doctor, BandwidthOfFormats) {
  EXPECT_DOUBLE_EQ(stream_bytes_per_second(PixelFormat::kYuyv, 640, 480, 30), 18'432'000);
  EXPECT_DOUBLE_EQ(stream_bytes_per_second(PixelFormat::kGrey, 640, 480, 30), 9'216'000);
}

class DoctorCamera : public ::testing::Test {
 protected:
  DoctorCamera() {
    auto& device = calls_.devices["/dev/video0"];
    device.width = 640;
    device.height = 480;
    device.fps = 30;
    fs::create_directories(folder_.path() / "sys/devices/usb1/1-2/1-2:1.0");
    fs::create_directories(folder_.path() / "sys/class/video4linux/video0");
    fs::create_directory_symlink("../../../devices/usb1/1-2/1-2:1.0",
                                 folder_.path() / "sys/class/video4linux/video0/device");
  }
  std::vector<Finding> check(const std::string& mbit, double fps = 30) {
    folder_.write("sys/devices/usb1/1-2/speed", mbit + "\n");
    return check_camera(calls_, folder_.path(), "/dev/video0", {PixelFormat::kGrey, 640, 480, fps});
  }

  ScratchFolder folder_;
  FakeV4l2 calls_;
};

TEST_F(DoctorCamera, BusIsComparedWithWhatTheFormatNeeds) {
  EXPECT_EQ(find(check("480"), "bus").health, Health::kOk);
  EXPECT_EQ(find(check("5000"), "bus").health, Health::kOk);
  const Finding slow = find(check("12"), "bus");
  EXPECT_EQ(slow.health, Health::kBad);
  EXPECT_NE(slow.state.find("needs 9.2"), std::string::npos) << slow.state;
  EXPECT_NE(slow.remedy.find("MJPG"), std::string::npos);
}

TEST_F(DoctorCamera, WhatIsNotThereOrNotOfferedIsBad) {
  EXPECT_EQ(check_camera(calls_, folder_.path(), "/dev/video9", {{}, 640, 480, 30})[0].health, Health::kBad);
  EXPECT_EQ(check_camera(calls_, folder_.path(), "/dev/video0", {PixelFormat::kMjpg, 640, 480, 30})[0].health,
            Health::kBad);
}

TEST_F(DoctorCamera, ADepthCameraOffersDepth) {
  auto& device = calls_.devices["/dev/video0"];
  device.formats = {V4L2_PIX_FMT_Z16};
  device.bytes_per_pixel = 2;
  EXPECT_EQ(check_camera(calls_, folder_.path(), "/dev/video0", {PixelFormat::kZ16, 640, 480, 30})[0].health,
            Health::kOk);
  EXPECT_EQ(check_camera(calls_, folder_.path(), "/dev/video0", {{}, 640, 480, 30})[0].health, Health::kBad);
}

TEST(Doctor, DiskIsMeasured) {
  const ScratchFolder folder;
  EXPECT_EQ(check_disk(folder.path(), 1, 1U << 20U).health, Health::kOk);
  EXPECT_EQ(check_disk(folder.path(), 1e15, 1U << 20U).health, Health::kBad);
  EXPECT_EQ(check_disk(folder.path() / "none", 1, 1U << 20U).health, Health::kBad);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Doctor, SlippedRowsAreNamed) {
  const std::vector<RowOffset> slipped{{1.8, 90}, {1.7, 80}, {-3, 20}, {1.9, 100}};
  const Finding finding = check_rows(slipped);
  EXPECT_EQ(finding.health, Health::kWarn);
  EXPECT_EQ(finding.state, "right images lie 1.80 rows lower than left ones");
  EXPECT_NE(finding.remedy.find("calibrate"), std::string::npos);
  EXPECT_EQ(check_rows(std::vector<RowOffset>{{-0.1, 90}}).health, Health::kOk);
  EXPECT_EQ(check_rows({}).health, Health::kWarn);
}

TEST(Doctor, DepthInTheWrongUnitIsNamed) {
  Rig rig;
  rig.kind = SensorKind::kRgbd;
  cv::Mat depth(48, 64, CV_16UC1, cv::Scalar(2000));  // 2 m in millimetres
  depth.rowRange(0, 12).setTo(0);
  const Finding fine = check_depth(std::vector{depth}, rig);
  EXPECT_EQ(fine.health, Health::kOk);
  EXPECT_EQ(fine.state, "in 75 % of the pixels, half of it nearer than 2.00 m, 100 % of it from 0.3 to 8 m");
  rig.depth_unit = 1.0 / 10'000;
  const Finding wrong = check_depth(std::vector{depth}, rig);
  EXPECT_EQ(wrong.health, Health::kWarn);
  EXPECT_NE(wrong.remedy.find("depth_scale"), std::string::npos);
}

TEST(Doctor, HardlyAnyDepthIsNamed) {
  Rig rig;
  rig.kind = SensorKind::kRgbd;
  cv::Mat depth(48, 64, CV_16UC1, cv::Scalar(0));
  EXPECT_EQ(check_depth(std::vector{depth}, rig).health, Health::kBad);
  depth.rowRange(0, 2).setTo(2000);
  EXPECT_EQ(check_depth(std::vector{depth}, rig).health, Health::kWarn);
}

}  // namespace
}  // namespace twofold
