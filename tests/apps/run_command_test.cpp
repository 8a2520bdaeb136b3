#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include <fmt/format.h>

#include "engine/logs/schedule_log.hpp"
#include "fixtures/bag_writer.hpp"
#include "fixtures/rendered_scene.hpp"
#include "io/files/trajectory_file.hpp"
#include "tests/apps/command.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

Rig small_rig() {
  Rig rig;
  rig.camera = {220, 220, 159.5, 119.5, 320, 240};
  rig.baseline = 0.12;
  return rig;
}

SE3 T_c_w(int i) {
  return {SO3::exp(Vector3(0, 0.004 * i, 0)), Vector3(0.004 * i, 0, -0.01 * i)};
}

/// A stereo recording in KITTI's layout, made once and copied by tests that damage it.
class RunCommand : public ::testing::Test {
 protected:
  static constexpr int kFrames = 24;

  static void SetUpTestSuite() {
    master_ = new ScratchFolder;
    fs::create_directories(master_->path() / "image_0");
    fs::create_directories(master_->path() / "image_1");
    twofold::testing::RenderedScene scene(small_rig(), Vector3(2.5, 2.0, 3.5), 5);
    const SE3 T_r_c(SO3(), Vector3(-small_rig().baseline, 0, 0));
    std::string times, poses;
    for (int i = 0; i < kFrames; ++i) {
      const std::string name = fmt::format("{:06}.png", i);
      cv::imwrite(*master_ / ("image_0/" + name), scene.render_one(T_c_w(i), 1));
      cv::imwrite(*master_ / ("image_1/" + name), scene.render_one(T_r_c * T_c_w(i), 1));
      times += fmt::format("{:.6f}\n", 0.05 * i);
      const Matrix4 m = T_c_w(i).inverse().matrix();
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 4; ++c) poses += fmt::format("{:.9f}{}", m(r, c), r == 2 && c == 3 ? '\n' : ' ');
      }
    }
    master_->write("times.txt", times);
    master_->write("poses.txt", poses);
    master_->write("calib.txt",
                   "P0: 220 0 159.5 0 0 220 119.5 0 0 0 1 0\nP1: 220 0 159.5 -26.4 0 220 119.5 0 0 0 1 0\n");
  }
  static void TearDownTestSuite() {
    delete master_;
    master_ = nullptr;
  }

  void SetUp() override {
    recording_ = folder_.path() / "recording";
    fs::copy(master_->path(), recording_, fs::copy_options::recursive);
  }
  Outcome run_recording(const std::string& options = "", const std::string& wrapper = "") {
    return run(folder_,
               "run 'kitti:" + recording_.string() + "' --out '" + (folder_ / "result") + "' " + options,
               wrapper);
  }
  [[nodiscard]] std::string result(const std::string& name) const {
    return content(folder_ / ("result/" + name));
  }
  void replace_in(const std::string& name, const std::string& from, const std::string& to) const {
    std::string text = content((recording_ / name).string());
    ASSERT_NE(text.find(from), std::string::npos);
    text.replace(text.find(from), from.size(), to);
    std::ofstream(recording_ / name) << text;
  }

  static ScratchFolder* master_;
  ScratchFolder folder_;
  fs::path recording_;
};
ScratchFolder* RunCommand::master_ = nullptr;

TEST_F(RunCommand, WritesEveryOutputAndFollowsTheTruth) {
  const Outcome outcome = run_recording("--deterministic --trace '" + (folder_ / "trace.json") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");  // no progress line where there is no terminal
  const Trajectory estimate = read_trajectory(folder_ / "result/trajectory.txt");
  ASSERT_EQ(estimate.size(), static_cast<std::size_t>(kFrames));
  for (int i = 0; i < kFrames; ++i) {
    const Vector3 truth = (T_c_w(0) * T_c_w(i).inverse()).translation();
    EXPECT_LT((estimate[static_cast<std::size_t>(i)].T_w_c.translation() - truth).norm(), 0.005) << i;
  }
  EXPECT_EQ(read_trajectory(folder_ / "result/trajectory_causal.txt").size(),
            static_cast<std::size_t>(kFrames));
  EXPECT_FALSE(cv::imread(folder_ / "result/trajectory.png").empty());
  EXPECT_FALSE(result("map.ply").empty());
  const auto summary = nlohmann::json::parse(result("summary.json"));
  EXPECT_EQ(summary["tracked"], kFrames);
  EXPECT_EQ(summary["why_lost"].size(), 0U);
  EXPECT_EQ(summary["globally_adjusted_keyframes"], 0) << "of a rig that recognised no place";
  const auto timing = nlohmann::json::parse(result("timing.json"));
  EXPECT_EQ(timing["tracker"]["frame"]["count"], kFrames);
  EXPECT_EQ(timing["run"]["frames"], kFrames);
  EXPECT_GT(timing["run"]["cpu_seconds"], 0.0);
  EXPECT_GT(timing["run"]["peak_rss_mb"], 1.0);
  const Outcome shown = twofold::run(folder_, "timing '" + (folder_ / "result") + "'");
  EXPECT_EQ(shown.exit_code, 0) << shown.err;
  EXPECT_NE(shown.out.find("p99.9"), std::string::npos);
  EXPECT_TRUE(nlohmann::json::parse(content(folder_ / "trace.json")).contains("traceEvents"));
}

/// Who reads the summary from another folder finds the recording.
TEST_F(RunCommand, TheSummaryNamesTheSourceByItsWholePath) {
  const std::string in_its_folder = "cd '" + folder_.path().string() + "' &&";
  for (const auto& [given, whole] : {std::pair<std::string, std::string>{"recording", recording_.string()},
                                     {"kitti:recording", "kitti:" + recording_.string()}}) {
    const Outcome outcome = run(folder_, "run " + given + " --deterministic --out result", in_its_folder);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(nlohmann::json::parse(result("summary.json"))["source"], whole);
  }
}

TEST_F(RunCommand, RealTimeWishesAreGrantedOrSaidNotToBe) {
  // The superuser has capabilities to be taken away before limits mean anything.
  const std::string unprivileged =
      geteuid() == 0 ? "setpriv --bounding-set -sys_nice,-ipc_lock --inh-caps -sys_nice,-ipc_lock" : "";
  const Outcome refused =
      run_recording("--preload --rt --pin 1023,0,0", "ulimit -r 0; ulimit -l 64; " + unprivileged);
  EXPECT_EQ(refused.exit_code, 0) << refused.err;
  for (const char* part :
       {"tracker: running on CPU 1023 only was refused", "SCHED_FIFO priority 50 was refused", "`ulimit -r`",
        "memory is not locked", "`ulimit -l", "`taskset -cp $$`"})
    EXPECT_NE(refused.out.find(part), std::string::npos) << part << "\n" << refused.out;
  EXPECT_EQ(nlohmann::json::parse(result("summary.json"))["notes"].size(), 3U);
  const Outcome pinned = run_recording("--preload --pin 0,0,0");
  EXPECT_EQ(pinned.exit_code, 0) << pinned.err;
  EXPECT_EQ(pinned.out.find("note"), std::string::npos) << pinned.out;
  EXPECT_NE(run_recording("--deterministic --rt").out.find("have no effect"), std::string::npos);
}

TEST_F(RunCommand, LiveRunIsReplayedByteForByte) {
  const std::vector<std::string> files{"trajectory.txt", "trajectory_causal.txt", "keyframes.txt", "map.ply",
                                       "schedule.log"};
  ASSERT_EQ(run_recording("--speed 2 --preload").exit_code, 0);
  std::vector<std::string> live;
  for (const std::string& file : files) live.push_back(result(file));
  fs::rename(folder_.path() / "result", folder_.path() / "live");
  const Outcome replay = run_recording("--replay-schedule '" + (folder_ / "live/schedule.log") + "'");
  ASSERT_EQ(replay.exit_code, 0) << replay.err;
  for (std::size_t i = 0; i < files.size(); ++i) EXPECT_EQ(result(files[i]), live[i]) << files[i];
}

TEST_F(RunCommand, APartOfARecordingIsRunReplayedAndEvaluated) {
  const std::string source = "'kitti:" + recording_.string() + "?first=10&frames=8'";
  const auto run_part = [&](const std::string& out, const std::string& options) {
    const Outcome outcome = run(folder_, "run " + source + " --out '" + out + "' " + options);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  };
  run_part(folder_ / "live", "--speed 2 --preload");
  const Trajectory estimate = read_trajectory(folder_ / "live/trajectory.txt");
  ASSERT_EQ(estimate.size(), 8U);
  EXPECT_EQ(estimate.front().t_ns, 500'000'000);
  EXPECT_EQ(estimate.back().t_ns, 850'000'000);
  std::string frames = content(folder_ / "live/frames.txt");
  frames = frames.substr(frames.find("\n") + 1);
  EXPECT_TRUE(frames.starts_with("10 ")) << frames;
  EXPECT_EQ(nlohmann::json::parse(content(folder_ / "live/summary.json"))["tracked"], 8);

  run_part(folder_ / "again", "--replay-schedule '" + (folder_ / "live/schedule.log") + "'");
  for (const char* file : {"/trajectory.txt", "/keyframes.txt", "/map.ply"})
    EXPECT_EQ(content(folder_ / "again" + file), content(folder_ / "live" + file)) << file;

  const Outcome evaluated = run(folder_, "eval '" + (folder_ / "live/trajectory.txt") + "' " + source +
                                             " --json '" + (folder_ / "e.json") + "'");
  ASSERT_EQ(evaluated.exit_code, 0) << evaluated.err;
  const auto json = nlohmann::json::parse(content(folder_ / "e.json"));
  EXPECT_EQ(json["poses"], 8);
  EXPECT_LT(json["ate_m"]["rmse"], 0.005);
}

/// A run that takes four seconds, as a process of its own.
pid_t start_at_a_pace(const fs::path& recording, const std::string& out) {
  const pid_t program = fork();
  if (program == 0) {
    const std::string source = "kitti:" + recording.string();
    std::signal(SIGHUP, SIG_DFL);  // the tests may run under nohup
    execl(TWOFOLD_BINARY, TWOFOLD_BINARY, "run", source.c_str(), "--preload", "--speed", "0.3", "--quiet",
          "--out", out.c_str(), nullptr);
    _exit(127);
  }
  return program;
}

/// Until `lines` poses are in the file; false when the program has ended before.
bool wait_for_lines(pid_t program, const std::string& file, int lines) {
  for (;;) {
    const std::string text = content(file);
    if (std::count(text.begin(), text.end(), '\n') > lines) return true;  // the first is a comment
    if (waitpid(program, nullptr, WNOHANG) != 0) return false;
    usleep(5000);
  }
}

TEST_F(RunCommand, InterruptedRunKeepsItsResults) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    SCOPED_TRACE(strsignal(signal));
    const pid_t program = start_at_a_pace(recording_, folder_ / "result");
    ASSERT_TRUE(wait_for_lines(program, folder_ / "result/trajectory_causal.txt", 3));
    kill(program, signal);
    int status = 0;
    waitpid(program, &status, 0);
    ASSERT_TRUE(WIFEXITED(status));
    ASSERT_EQ(WEXITSTATUS(status), 0);
    const auto summary = nlohmann::json::parse(result("summary.json"));
    EXPECT_EQ(summary["interrupted"], true);
    EXPECT_GT(summary["tracked"], 2);
    EXPECT_LT(summary["tracked"], kFrames);
    EXPECT_FALSE(read_trajectory(folder_ / "result/trajectory.txt").empty());
    EXPECT_FALSE(result("map.ply").empty());
    fs::remove_all(folder_ / "result");
  }
}

TEST_F(RunCommand, AnInterruptionBeforeOneCameraHasStartedIsNoFailure) {
  const Outcome outcome =
      run_recording("--camera mono --speed 0.02 --preload", "timeout --preserve-status -s INT 2");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto summary = nlohmann::json::parse(result("summary.json"));
  EXPECT_EQ(summary["interrupted"], true);
  EXPECT_EQ(summary["tracked"], 0);
}

TEST_F(RunCommand, TheFolderOfTheSourceIsNoOutputFolder) {
  const std::string truth = recording_.string() + "/groundtruth.txt";
  std::ofstream(truth) << "mine\n";
  fs::create_directory_symlink(recording_, folder_.path() / "link");
  const std::string source = "run 'kitti:" + recording_.string() + "' --deterministic --out '";
  for (const std::string& out : {recording_.string(), folder_ / "link", recording_.string() + "/image_0/.."})
    expect_bad_input(run(folder_, source + out + "'"), "is the folder of the source");
  EXPECT_EQ(content(truth), "mine\n");
}

TEST_F(RunCommand, OnlyWhatARunHasWrittenIsReplaced) {
  const std::string foreign = folder_.write("result/summary.json", "{\"source\": \"my thesis\"}");
  expect_bad_input(run_recording("--deterministic"), "result/summary.json: would be overwritten");
  EXPECT_EQ(content(foreign), "{\"source\": \"my thesis\"}");
  fs::remove(foreign);
  folder_.write("result/map.ply", "mine");
  folder_.write("result/notes.txt", "mine");
  expect_bad_input(run_recording("--deterministic"), "result/map.ply: would be overwritten");
  EXPECT_EQ(result("map.ply"), "mine");
  fs::remove(folder_ / "result/map.ply");
  ASSERT_EQ(run_recording("--deterministic").exit_code, 0);
  fs::remove(folder_ / "result/schedule.log");
  EXPECT_EQ(run_recording("--deterministic").exit_code, 0) << "by summary.json";
  fs::remove(folder_ / "result/summary.json");
  EXPECT_EQ(run_recording("--deterministic").exit_code, 0) << "by schedule.log";
  EXPECT_EQ(result("notes.txt"), "mine");
}

/// Killed while it runs, at several times: causal trajectory and schedule are there up to then, and the
/// schedule repeats what was done.
TEST_F(RunCommand, AKilledRunLeavesItsTrajectoryAndItsSchedule) {
  for (const int tracked : {2, 9}) {
    SCOPED_TRACE(tracked);
    const std::string out = folder_ / "killed";
    const pid_t program = start_at_a_pace(recording_, out);
    ASSERT_TRUE(wait_for_lines(program, out + "/trajectory_causal.txt", tracked));
    kill(program, SIGKILL);
    int status = 0;
    waitpid(program, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status));
    const Trajectory causal = read_tum_trajectory(out + "/trajectory_causal.txt");
    ASSERT_GE(causal.size(), static_cast<std::size_t>(tracked));
    EXPECT_FALSE(fs::exists(out + "/trajectory.txt"));
    std::ifstream log(out + "/schedule.log", std::ios::binary);
    const auto schedule = read_schedule(log);
    ASSERT_TRUE(schedule) << schedule.error();
    EXPECT_FALSE(schedule->ended);
    EXPECT_GE(schedule->tracker.size() + 1, causal.size());  // each is written by itself
    const Outcome replay = run_recording("--replay-schedule '" + out + "/schedule.log'");
    ASSERT_EQ(replay.exit_code, 0) << replay.err;
    const std::string killed = content(out + "/trajectory_causal.txt"),
                      again = result("trajectory_causal.txt");
    const std::size_t both = std::min(killed.size(), again.size());
    EXPECT_EQ(killed.substr(0, both), again.substr(0, both));
    EXPECT_GE(std::count(again.begin(), again.end(), '\n'), tracked);
    fs::remove_all(out);
  }
}

TEST_F(RunCommand, WrongOptionsAreOneLineAndExitCodeTwo) {
  expect_bad_input(run(folder_, "run"), "SOURCE");
  expect_bad_input(run_recording("--speed fast"), "--speed");
  expect_bad_input(run_recording("--speed -1"), "--speed");
  expect_bad_input(run_recording("--windows 25"), "--windows");
  expect_bad_input(run_recording("--windows 0,10"), "--windows");
  expect_bad_input(run_recording("--windows 25,x"), "--windows: 'x' is not a number");
  expect_bad_input(run_recording("--windows 99999999999,175"), "--windows: '99999999999' is out of range");
  expect_bad_input(run_recording("--pin 0,-1,0"), "--pin: CPUs count from 0");
  expect_bad_input(run_recording("--poses p.jsonl --poses ./p.jsonl"), "--poses: ./p.jsonl: is given twice");
  expect_bad_input(run_recording("--poses zmq:foo"), "zmq:");
  expect_bad_input(run_recording("--late never"), "late");
  expect_bad_input(run_recording("--deterministic --speed 1"),
                   "--speed: has no meaning with --deterministic");
  expect_bad_input(run_recording("--deterministic --replay-schedule x"), "--replay-schedule: repeats");
  expect_bad_input(run_recording("--poses-form tum"), "--poses-form: needs --poses");
  expect_bad_input(run_recording("--window 20"), "--window: is for --estimator swf");
  expect_bad_input(run_recording("--estimator swf --window -1"), "--window: must be a number >= 0, is -1");
  expect_bad_input(run_recording("--late drop"), "--late: needs a pace");
  expect_bad_input(run_recording("--camera mono --calib auto --load-map m.tfm"),
                   "--calib auto: finds other numbers each time");
  expect_bad_input(run_recording("--late drop --deterministic"), "--late: needs a pace");
  expect_bad_input(run_recording("--replay-schedule /nonexistent"), "/nonexistent");
  expect_bad_input(run_recording("--calib /nonexistent.yaml"), "/nonexistent.yaml");
  folder_.write("noise.log", "this is no schedule");
  expect_bad_input(run_recording("--replay-schedule '" + (folder_ / "noise.log") + "'"), "noise.log");
  for (const std::string option :
       {"--load-map", "--save-map", "--replay-schedule", "--vocabulary", "--calib", "--trace"})
    expect_bad_input(run_recording(option + " ''"), option + ": is empty");
  expect_bad_input(run_recording("--vocabulary /nonexistent"), "/nonexistent: cannot be opened");
  expect_bad_input(run_recording("--vocabulary " + folder_.path().string()), "is not a file of bytes");
  expect_bad_input(run_recording("--trace /nonexistent/trace"),
                   "/nonexistent/trace: the folder is not there");
  expect_bad_input(run_recording("--trace " + folder_.path().string()), "is a folder");
  expect_bad_input(run(folder_, "run synthetic:desk --calib c.yaml"), "c.yaml: is not asked for");
  expect_bad_input(run(folder_, "run nosuch:thing"), "nosuch");
  expect_bad_input(run(folder_, "run kitti:/nonexistent"), "/nonexistent");
  expect_bad_input(run(folder_, "run kitti:" + recording_.string() + " --out /proc/nothing/here"),
                   "/proc/nothing");
}

TEST_F(RunCommand, TheFilterRefusesWhatItDoesNotDo) {
  for (const std::string option :
       {"--save-map m.tfm", "--checkpoint 5", "--load-map m.tfm", "--localise-only", "--record rec",
        "--trace t", "--replay-schedule s.log", "--speed 1", "--late drop", "--pin 0,0,0", "--rt",
        "--windows 20,35", "--vocabulary v", "--no-places", "--no-metric-loops", "--poses -", "--calib auto"})
    expect_bad_input(run_recording("--estimator swf " + option),
                     option.substr(0, option.find(' ')) + (option == "--calib auto" ? " auto" : "") +
                         ": is not for --estimator swf");
}

TEST_F(RunCommand, AReplayDoesNotOverwriteItsSchedule) {
  ASSERT_EQ(run_recording().exit_code, 0);
  const std::string schedule = result("schedule.log"), poses = result("trajectory.txt");
  expect_bad_input(run_recording("--replay-schedule '" + (folder_ / "result/../result/schedule.log") + "'"),
                   "is in the folder that the replay would write to");
  EXPECT_EQ(result("schedule.log"), schedule);
  EXPECT_EQ(result("trajectory.txt"), poses);
}

TEST_F(RunCommand, AScheduleOfAnotherInputIsRefusedBeforeTheEarlierRunGoes) {
  ASSERT_EQ(run_recording().exit_code, 0);
  const std::string schedule = folder_ / "first.log";
  fs::copy(folder_ / "result/schedule.log", schedule);
  const std::string poses = result("trajectory.txt");
  fs::remove_all(recording_ / "image_1");
  fs::copy(recording_ / "image_0", recording_ / "image_1");
  fs::remove(recording_ / "image_1/000000.png");
  fs::copy(master_->path() / "image_1/000001.png", recording_ / "image_1/000000.png");
  expect_bad_input(run_recording("--replay-schedule '" + schedule + "'"),
                   "first.log: the schedule belongs to another recording");
  replace_in("calib.txt", "P1: 220 0 159.5 -26.4", "P1: 220 0 159.5 -26.5");
  expect_bad_input(run_recording("--replay-schedule '" + schedule + "'"),
                   "first.log: the schedule belongs to another rig");
  EXPECT_EQ(result("trajectory.txt"), poses);
}

/// What an earlier run left goes when this one begins, not when it is refused.
TEST_F(RunCommand, AFolderHoldsOneRun) {
  ASSERT_EQ(run_recording().exit_code, 0);
  const std::string summary = result("summary.json"), schedule = result("schedule.log");
  expect_bad_input(run_recording("--poses unix:/nonexistent/socket"), "/nonexistent");
  EXPECT_EQ(result("summary.json"), summary);
  EXPECT_EQ(result("schedule.log"), schedule);
  folder_.write("result/schedule.log.new", "of a run that was killed");
  folder_.write("result/keyframes_loaded.txt", "of a run in a loaded map");
  folder_.write("result/map.tfm", "saved by whoever looked");
  ASSERT_EQ(run_recording("--deterministic").exit_code, 0);
  EXPECT_FALSE(fs::exists(folder_ / "result/schedule.log.new"));
  EXPECT_FALSE(fs::exists(folder_ / "result/keyframes_loaded.txt"));
  EXPECT_EQ(result("map.tfm"), "saved by whoever looked");
}

/// What a recording cannot deliver is known with its first frame.
TEST_F(RunCommand, AFirstFrameThatCannotBeReadLeavesTheEarlierRun) {
  ASSERT_EQ(run_recording().exit_code, 0);
  const std::string poses = result("trajectory.txt"), summary = result("summary.json");
  const fs::path first = recording_ / "image_1/000000.png";
  cv::imwrite(first.string(), cv::Mat(100, 100, CV_8UC1, cv::Scalar(9)));
  for (const char* estimator : {"engine", "swf"}) {
    const Outcome refused = run_recording(std::string("--estimator ") + estimator);
    expect_bad_input(refused, "image_1/000000.png: the image is 100x100, the first image");
    EXPECT_EQ(refused.out, "");
  }
  fs::remove(first);
  expect_bad_input(run_recording("--camera mono --estimator swf"), "is not stereo");
  EXPECT_EQ(result("trajectory.txt"), poses);
  EXPECT_EQ(result("summary.json"), summary);
}

TEST_F(RunCommand, ARunWithoutFramesHasNoCostAFrame) {
  std::ofstream log(folder_ / "empty.log", std::ios::binary);
  ASSERT_TRUE(write_schedule(log, ScheduleStreams()));
  log.close();
  const Outcome outcome = run_recording("--replay-schedule '" + (folder_ / "empty.log") + "'");
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_NE(outcome.out.find("frames      0 ("), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find(" s CPU, "), std::string::npos) << outcome.out;
}

/// Each estimator leaves a folder that holds its own files alone.
TEST_F(RunCommand, NothingOfAnotherEstimatorStays) {
  ASSERT_EQ(run_recording("--deterministic").exit_code, 0);
  ASSERT_EQ(run_recording("--estimator swf").exit_code, 0);
  for (const char* name : {"map.ply", "schedule.log", "frames.txt", "keyframes.txt", "timing.json"})
    EXPECT_FALSE(fs::exists(folder_.path() / "result" / name)) << name;
  EXPECT_TRUE(fs::exists(folder_ / "result/structure.ply"));
  ASSERT_EQ(run_recording("--deterministic").exit_code, 0);
  EXPECT_FALSE(fs::exists(folder_ / "result/structure.ply"));
}

/// A walk that turns shows the focal length, and the file that is written gives the next run the same camera.
TEST_F(RunCommand, OneCameraIsCalibratedByItsOwnVideo) {
  constexpr double kFocalLength = 256;
  const Outcome rendered =
      run(folder_, "render 'synthetic:courtyard?frames=160&width=320&height=240&f=256&noise=2' --out '" +
                       (folder_ / "recording") + "'");
  ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
  const std::string source =
      "run 'euroc:" + (folder_ / "recording") + "' --camera mono --deterministic --out '";
  const Outcome outcome = run(folder_, source + (folder_ / "auto") + "' --calib auto --quiet");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("calibration f "), std::string::npos) << outcome.out;
  const auto summary = nlohmann::json::parse(content(folder_ / "auto/summary.json"));
  const auto& found = summary["self_calibration"];
  const double sigma = found["focal_sigma_px"];
  EXPECT_LT(sigma, 0.04 * kFocalLength);
  EXPECT_NEAR(found["focal_px"].get<double>(), kFocalLength, 3 * sigma);
  EXPECT_EQ(found["file"], folder_ / "auto/calibration.yaml");
  EXPECT_EQ(content(folder_ / "auto/calibration.yaml").find("readout"), std::string::npos);
  EXPECT_GT(found["readout_sigma_ms"].get<double>(), 0);
  EXPECT_GT(summary["globally_adjusted_keyframes"], 0);
  ASSERT_TRUE(summary["focal_length"].is_object());
  EXPECT_FALSE(summary["focal_length"]["contradicts_calibration"]);
  const double of_map = summary["focal_length"]["map_px"];
  EXPECT_NEAR(of_map, kFocalLength, 3 * summary["focal_length"]["sigma_px"].get<double>());
  const Outcome anew = run(folder_, source + (folder_ / "auto") + "' --calib auto --poses -");
  EXPECT_EQ(anew.exit_code, 0) << "a run may replace what it has found itself: " << anew.err;
  EXPECT_TRUE(anew.out.starts_with("{")) << "standard output has the poses alone: " << anew.out.substr(0, 80);
  const Outcome again =
      run(folder_, source + (folder_ / "again") + "' --calib '" + (folder_ / "auto/calibration.yaml") + "'");
  EXPECT_EQ(again.exit_code, 0) << again.err;
}

TEST_F(RunCommand, OneCamerasLengthsAreNotCalledMetres) {
  ASSERT_EQ(run(folder_,
                "run 'synthetic:desk?frames=40&width=320&height=240' --camera mono --deterministic "
                "--out '" +
                    (folder_ / "result") + "'")
                .exit_code,
            0);
  EXPECT_NE(result("map.ply").find("comment an arbitrary unit of length\n"), std::string::npos);
  ASSERT_EQ(run_recording("--deterministic").exit_code, 0);
  EXPECT_NE(result("map.ply").find("comment metres\n"), std::string::npos);
}

TEST_F(RunCommand, ACameraWhoseCentreIsOutsideOfTheImagesIsRefused) {
  for (const char* name : {"P0", "P1"})
    replace_in("calib.txt", name + std::string(": 220 0 159.5"), name + std::string(": 220 0 601.9"));
  expect_bad_input(
      run_recording("--camera mono"),
      "calib.txt: the camera's centre, cx = 601.9 and cy = 119.5, is not in the images, which are 320x240");
}

TEST_F(RunCommand, SomebodysCalibrationInTheOutputFolderIsNotOverwritten) {
  const std::string somebodys =
      "sensor: mono\ncameras:\n  - {size: [64, 48], intrinsics: [50, 50, 32, 24]}\n";
  const auto refused = [&] {
    fs::create_directories(folder_.path() / "result");
    folder_.write("result/calibration.yaml", somebodys);
    expect_bad_input(run_recording("--camera mono --calib auto"),
                     "calibration.yaml: would be overwritten by what --calib auto finds");
    EXPECT_EQ(content(folder_ / "result/calibration.yaml"), somebodys);
  };
  refused();
  ASSERT_EQ(run_recording("--deterministic").exit_code, 0);
  refused();  // a run has left its mark there, but did not write this file
}

TEST_F(RunCommand, ACalibrationThatIsLeftOfARefusedRunIsReplaced) {
  fs::create_directories(folder_.path() / "result");
  folder_.write("result/calibration.yaml", "sensor: mono\nquality:\n  board: none, the video itself\n");
  const Outcome outcome = run_recording("--camera mono --calib auto");
  EXPECT_EQ(outcome.err.find("would be overwritten"), std::string::npos) << outcome.err;
}

TEST_F(RunCommand, WhatDoesNotShowTheCalibrationIsRefused) {
  expect_bad_input(run_recording("--calib auto"), "add --camera mono");
  expect_bad_input(run_recording("--camera mono --calib auto"), "the camera moved too little");
}

void expect_failed_run(const Outcome& outcome, const std::vector<std::string>& parts) {
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  for (const std::string& part : parts) EXPECT_NE(outcome.err.find(part), std::string::npos) << outcome.err;
}

TEST_F(RunCommand, WhereAMapCannotBeWrittenIsSaidBeforeTheRun) {
  const auto expect_refused = [&](const std::string& file, const std::string& why) {
    expect_bad_input(run_recording("--deterministic --save-map '" + file + "'"), why);
    EXPECT_FALSE(fs::exists(folder_ / "result"));
  };
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  expect_refused(folder_ / "pipe", "pipe: is no regular file");
  EXPECT_TRUE(fs::is_fifo(folder_ / "pipe"));
  folder_.write("letter.txt", "Dear");
  expect_refused(folder_ / "letter.txt", "letter.txt: is there already and no map");
  EXPECT_EQ(content(folder_ / "letter.txt"), "Dear");
  expect_refused(folder_.path().string(), "is a folder");
  expect_refused("/proc/map.tfm", "/proc/map.tfm.tmp: cannot be opened");
}

TEST_F(RunCommand, AFullDiskIsOneLineThatNamesAllThatIsMissing) {
  // No file may grow beyond 8 KiB: writing fails as it does on a full disk.
  const std::string full_disk = "trap '' XFSZ; ulimit -f 16;";
  expect_failed_run(run_recording("--deterministic --save-map '" + (folder_ / "map.tfm") + "' --poses '" +
                                      (folder_ / "poses.jsonl") + "'",
                                  full_disk),
                    {"poses.jsonl: File too large: the last", "map.tfm.tmp: cannot be written",
                     "timing.json: cannot be written"});
  EXPECT_FALSE(fs::exists(folder_.path() / "map.tfm"));
  const auto summary = nlohmann::json::parse(result("summary.json"));
  EXPECT_EQ(summary["errors"].size(), 2U) << "what was lost before the folder was written";
  expect_failed_run(
      run_recording("--deterministic", "trap '' XFSZ; prlimit --pid $$ --fsize=1500;"),
      {"(records of frames): File too large; ", " s to 1.150000000 s: their frames lack a final",
       "trajectory_causal.txt: File too large; ", " poses are missing, from "});
  // Not even the reason has room in its file: the exit code is there all the same.
  EXPECT_EQ(run_recording("--deterministic", "trap '' XFSZ; prlimit --pid $$ --fsize=100;").exit_code, 1);
}

TEST_F(RunCommand, PosesThatWereLostAreInTheSummary) {
  expect_failed_run(run_recording("--deterministic --poses /dev/full"),
                    {"--poses /dev/full: No space left on device: the last 24 lines are missing"});
  const auto summary = nlohmann::json::parse(result("summary.json"));
  ASSERT_EQ(summary["errors"].size(), 1U);
  EXPECT_NE(summary["errors"][0].get<std::string>().find("/dev/full"), std::string::npos);
  EXPECT_EQ(summary["error"], summary["errors"][0]);
}

TEST_F(RunCommand, ARecordingThatAFullDiskCutIsAFailure) {
  const std::string full_disk = "trap '' XFSZ; prlimit --pid $$ --fsize=16384;";  // an image is larger
  for (const std::string order : {"", "--deterministic "}) {
    const std::string folder = folder_ / (order.empty() ? "recorded" : "recorded again");
    expect_failed_run(
        run_recording(order + "--record '" + folder + "'", full_disk),
        {"--record " + folder + ": 24 frames are missing in the recording", "cannot be written"});
    EXPECT_NE(result("summary.json").find("missing in the recording"), std::string::npos);
  }
}

/// The disk is full for the first two seconds of four: afterwards nothing is missing.
TEST_F(RunCommand, AFolderOnADiskThatIsFullForAWhileIsWholeInTheEnd) {
  const std::string whole = folder_ / "whole.txt";
  ASSERT_EQ(run_recording("--preload --speed 0.3").exit_code, 0);
  fs::rename(folder_.path() / "result/trajectory_causal.txt", whole);
  folder_.write("full.sh",
                "trap '' XFSZ\nprlimit --pid $$ --fsize=150:unlimited\n\"$@\" &\nprogram=$!\nsleep 2\n"
                "cp '" +
                    (folder_ / "result/trajectory_causal.txt") + "' '" + (folder_ / "then.txt") +
                    "'\nprlimit --pid $program --fsize=unlimited\nwait $program\n");
  const Outcome outcome = run_recording("--preload --speed 0.3", "sh '" + (folder_ / "full.sh") + "'");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::string then = content(folder_ / "then.txt");
  EXPECT_EQ(std::count(then.begin(), then.end(), '\n'), 2) << "a comment and a pose";
  EXPECT_TRUE(then.ends_with("\n"));
  EXPECT_EQ(read_tum_trajectory(folder_ / "result/trajectory_causal.txt").size(),
            read_tum_trajectory(whole).size());
  std::ifstream log(folder_ / "result/schedule.log", std::ios::binary);
  const auto schedule = read_schedule(log);
  ASSERT_TRUE(schedule) << schedule.error();
  EXPECT_TRUE(schedule->ended);
  EXPECT_EQ(schedule->tracker.size(), static_cast<std::size_t>(kFrames));
}

/// The recording's images in a bag, with what their calibration says.
void write_mcap(const fs::path& recording, const fs::path& file) {
  using namespace twofold::testing;
  WrittenBag bag;
  std::array<WrittenCameraInfo, 2> infos;
  for (std::uint32_t n = 0; n < 2; ++n) {
    const std::string side = n == 0 ? "/left" : "/right";
    bag.topics.push_back({side + "/image_rect", "sensor_msgs/Image"});
    bag.topics.push_back({side + "/camera_info", "sensor_msgs/CameraInfo"});
    infos.at(n).width = 320;
    infos.at(n).height = 240;
    infos.at(n).P = {220, 0, 159.5, n == 0 ? 0 : -26.4, 0, 220, 119.5, 0, 0, 0, 1, 0};
    bag.messages.push_back({2 * n + 1, 0, camera_info_message(MessageEncoding::kCdr, infos.at(n))});
  }
  std::ifstream times(recording / "times.txt");
  double seconds = 0;
  for (int i = 0; times >> seconds; ++i) {
    const auto t_ns = static_cast<std::int64_t>(std::llround(seconds * 1e9));
    for (std::uint32_t n = 0; n < 2; ++n) {
      const cv::Mat image =
          cv::imread((recording / fmt::format("image_{}/{:06}.png", n, i)).string(), cv::IMREAD_GRAYSCALE);
      bag.messages.push_back({2 * n, t_ns, image_message(MessageEncoding::kCdr, t_ns, image, "mono8")});
    }
  }
  const Bytes bytes = mcap_file(bag, {MessageEncoding::kCdr, "zstd", 8, true, true});
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

TEST_F(RunCommand, ARecordingInABagGivesTheSameBytes) {
  const std::vector<std::string> files{"trajectory.txt", "map.ply"};
  ASSERT_EQ(run_recording("--deterministic").exit_code, 0);
  std::vector<std::string> from_folder;
  for (const std::string& file : files) from_folder.push_back(result(file));
  write_mcap(recording_, folder_.path() / "recording.mcap");
  const std::string arguments =
      "run 'mcap:" + (folder_ / "recording.mcap") + "' --deterministic --out '" + (folder_ / "result") + "'";
  const Outcome outcome = run(folder_, arguments);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  for (std::size_t i = 0; i < files.size(); ++i) EXPECT_EQ(result(files[i]), from_folder[i]) << files[i];
  fs::resize_file(folder_.path() / "recording.mcap", fs::file_size(folder_.path() / "recording.mcap") / 2);
  const Outcome cut = run(folder_, arguments);
  EXPECT_EQ(cut.exit_code, 0) << cut.err;
  EXPECT_NE(cut.out.find("recording.mcap: is cut short at byte"), std::string::npos) << cut.out;
  expect_bad_input(run(folder_, "run 'mcap:" + (folder_ / "nothing") + "'"), "nothing: no such file");
}

TEST_F(RunCommand, BrokenRecordingsAreOneLineAndExitCodeTwo) {
  const auto damaged = [&](const std::string& what, const std::string& message, const auto& damage) {
    SCOPED_TRACE(what);
    fs::remove_all(recording_);
    fs::copy(master_->path(), recording_, fs::copy_options::recursive);
    damage();
    expect_bad_input(run_recording("--deterministic"), message);
  };
  damaged("empty folder", "", [&] {
    fs::remove_all(recording_);
    fs::create_directory(recording_);
  });
  damaged("images that cannot be decoded", "000015.png", [&] {
    for (int i = 5; i < kFrames; ++i)
      std::ofstream(recording_ / fmt::format("image_0/{:06}.png", i)) << "not an image";
  });
  damaged("image of another size", "000007.png", [&] {
    cv::imwrite((recording_ / "image_1/000007.png").string(), cv::Mat(100, 100, CV_8UC1, cv::Scalar(9)));
  });
  damaged("calibration without a key", "calib.txt", [&] { replace_in("calib.txt", "P1:", "Q1:"); });
  damaged("negative focal length", "calib.txt", [&] { replace_in("calib.txt", "P0: 220", "P0: -220"); });
  damaged("repeated time stamp", "times.txt", [&] { replace_in("times.txt", "0.100000", "0.050000"); });
  damaged("time stamps out of order", "times.txt", [&] { replace_in("times.txt", "0.100000", "0.010000"); });
  damaged("a download that ended early", "image_1/000015.png: no such image file", [&] {
    for (int i = 5; i < kFrames; ++i) fs::remove(recording_ / fmt::format("image_1/{:06}.png", i));
  });
}

TEST_F(RunCommand, ADamagedImageIsLeftOutAndTold) {
  std::ofstream(recording_ / "image_1/000005.png") << "not an image";
  const Outcome outcome = run_recording("--deterministic");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("left out: 1 frame with a damaged image"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("000005.png: the image cannot be decoded"), std::string::npos) << outcome.out;
  EXPECT_EQ(read_tum_trajectory(folder_.path() / "result/trajectory.txt").size(),
            static_cast<std::size_t>(kFrames - 1));
}

TEST_F(RunCommand, ATruthThatCannotBeReadStopsNoRun) {
  replace_in("poses.txt", "1.000000000", "nan");
  const Outcome outcome = run_recording("--deterministic");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("poses.txt:1: 'nan' is not a finite number; the ground truth is left out"),
            std::string::npos)
      << outcome.out;
  EXPECT_FALSE(fs::exists(folder_.path() / "result/groundtruth.txt"));
  const auto notes = nlohmann::json::parse(result("summary.json"))["notes"];
  ASSERT_EQ(notes.size(), 1U);
  expect_bad_input(
      run(folder_, "eval '" + (folder_ / "result/trajectory.txt") + "' '" + recording_.string() + "'"),
      "poses.txt:1: 'nan'");
}

TEST_F(RunCommand, PosesLeaveTheProgramWhileItRuns) {
  const std::string file = folder_ / "live.txt";
  const Outcome outcome = run_recording("--deterministic --poses-form tum --poses '" + file + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Trajectory live = read_tum_trajectory(file);
  const Trajectory causal = read_tum_trajectory(folder_ / "result/trajectory_causal.txt");
  ASSERT_EQ(live.size(), static_cast<std::size_t>(kFrames));
  for (std::size_t i = 0; i < live.size(); ++i) {
    EXPECT_EQ(live[i].t_ns, causal[i].t_ns);
    EXPECT_LT((live[i].T_w_c.inverse() * causal[i].T_w_c).log().norm(), 1e-6);
  }
}

TEST_F(RunCommand, StandardOutputBelongsToThePosesWhenTheyGoThere) {
  const Outcome outcome = run_recording("--deterministic --poses -");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("frames      24 (24 tracked"), std::string::npos) << outcome.err;
  std::istringstream lines(outcome.out);
  int tracked = 0;
  for (std::string line; std::getline(lines, line);) {
    tracked += nlohmann::json::parse(line).value("state", "") == "tracked";
  }
  EXPECT_EQ(tracked, kFrames);
}

TEST_F(RunCommand, PosesThatNobodyReadsAnyMoreDoNotEndTheRun) {
  const std::string command = std::string(TWOFOLD_BINARY) + " run 'kitti:" + recording_.string() +
                              "' --out '" + (folder_ / "result") + "' --poses - 2>'" + (folder_ / "err") +
                              "' | head -1 >'" + (folder_ / "out") + "'";
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(nlohmann::json::parse(result("summary.json"))["tracked"], kFrames);
  for (const std::string target : {"udp:127.0.0.1:70000", "zmq:tcp://127.0.0.1:70000"})
    expect_bad_input(run_recording("--poses " + target), "a port is 65535 at most");
  expect_bad_input(run_recording("--poses udp:nonsense"), "--poses: udp:nonsense: must be udp:HOST:PORT");
}

TEST_F(RunCommand, RecordingWithoutTextureIsAFailedRun) {
  for (int i = 0; i < kFrames; ++i) {
    for (const char* side : {"image_0", "image_1"}) {
      cv::imwrite((recording_ / side / fmt::format("{:06}.png", i)).string(),
                  cv::Mat(240, 320, CV_8UC1, cv::Scalar(120)));
    }
  }
  const Outcome outcome = run_recording("--deterministic");
  EXPECT_EQ(outcome.exit_code, 1);
  const auto summary = nlohmann::json::parse(result("summary.json"));
  const std::string cause = summary["why_lost"].back()["cause"];
  EXPECT_NE(outcome.err.find("no frame could be tracked: " + cause), std::string::npos) << outcome.err;
  EXPECT_EQ(summary["why_lost"].size(), static_cast<std::size_t>(kFrames));
}

}  // namespace
}  // namespace twofold
