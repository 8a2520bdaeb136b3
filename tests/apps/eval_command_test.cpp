#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgcodecs.hpp>

#include <fmt/format.h>

#include "io/files/trajectory_file.hpp"
#include "tests/apps/command.hpp"

namespace twofold {
namespace {

std::string write_circle(const ScratchFolder& folder, const std::string& name, double scale) {
  Trajectory trajectory;
  for (int i = 0; i < 60; ++i) {
    trajectory.push_back(
        {i * 100'000'000LL, SE3(SO3::exp(Vector3(0, 0, 0.1 * i)),
                                scale * Vector3(std::cos(0.1 * i), std::sin(0.1 * i), 0.01 * i))});
  }
  write_tum_trajectory(folder.path() / name, trajectory);
  return folder / name;
}

TEST(EvalCommand, WritesTableJsonAndPlot) {
  const ScratchFolder folder;
  const auto truth = write_circle(folder, "truth.txt", 1);
  const auto estimate = write_circle(folder, "estimate.txt", 0.5);
  const auto outcome = run(folder, "eval " + estimate + " " + truth + " --align sim3 --json " +
                                       (folder / "e.json") + " --plot " + (folder / "e.png"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out.find("RPE over 1 s"), std::string::npos);
  const auto json = nlohmann::json::parse(content(folder / "e.json"));
  EXPECT_NEAR(json["alignment"]["scale"].get<double>(), 2.0, 1e-6);
  EXPECT_NEAR(json["half_scales"][1].get<double>(), 2.0, 1e-5);
  EXPECT_LT(json["ate_m"]["rmse"].get<double>(), 1e-6);
  EXPECT_EQ(json["poses"], 60);
  EXPECT_EQ(cv::imread(folder / "e.png").empty(), false);
}

TEST(EvalCommand, SaysThatOneCamerasScaleIsArbitrary) {
  const ScratchFolder folder;
  const auto truth = write_circle(folder, "truth.txt", 1);
  const auto estimate = write_circle(folder, "trajectory.txt", 0.5);
  const auto is_said = [&](const std::string& options) {
    const auto outcome = run(folder, "eval " + estimate + " " + truth + options);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.err.find("whose scale is arbitrary: --align sim3") != std::string::npos;
  };
  EXPECT_FALSE(is_said(""));
  folder.write("summary.json", R"({"scale": "arbitrary"})");
  EXPECT_TRUE(is_said(""));
  EXPECT_FALSE(is_said(" --align sim3"));
  for (const char* other : {R"({"scale": "metric"})", R"({"scale": 3})", "[]", "no JSON"}) {
    folder.write("summary.json", other);
    EXPECT_FALSE(is_said("")) << other;
  }
}

/// As of folders that come out of old archives.
TEST(EvalCommand, NamesMayHoldBytesThatAreNoText) {
  const ScratchFolder folder;
  const auto truth = write_circle(folder, "w\xe4hr.txt", 1);
  const auto outcome = run(folder, "eval " + truth + " " + truth + " --json " + (folder / "e.json"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(content(folder / "e.json"))["poses"], 60);
}

TEST(EvalCommand, ANameThatNoFileCanHaveIsBadInput) {
  const ScratchFolder folder;
  const auto truth = write_circle(folder, "truth.txt", 1);
  expect_bad_input(run(folder, "eval " + std::string(300, 'a') + " " + truth), "too long");
  expect_bad_input(run(folder, "eval " + truth + " " + std::string(300, 'a')), "too long");
}

TEST(EvalCommand, LongPathsHaveKittisFigures) {
  const ScratchFolder folder;
  const auto figures = [&](double truth_scale, double estimate_scale) {
    const auto truth = write_circle(folder, "truth.txt", truth_scale);
    const auto estimate = write_circle(folder, "estimate.txt", estimate_scale);
    const auto outcome =
        run(folder, "eval " + estimate + " " + truth + " --align none --json " + (folder / "e.json"));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.out;
  };
  const std::string out = figures(40, 40.4);  // 236 m, 1 % too long
  EXPECT_NE(out.find("KITTI's t_rel "), std::string::npos) << out;
  EXPECT_NE(out.find("segments of 100 and 200 m"), std::string::npos) << out;
  const auto kitti = nlohmann::json::parse(content(folder / "e.json"))["kitti"];
  EXPECT_EQ(kitti["count"], 5) << "from poses 0, 10, 20 and 30 over 100 m, from pose 0 over 200 m";
  ASSERT_EQ(kitti["by_length"].size(), 2U);
  EXPECT_EQ(kitti["by_length"][1]["length_m"], 200);
  EXPECT_NEAR(kitti["r_rel_deg_per_100_m"].get<double>(), 0, 1e-5);
  // 25 poses are the first to be more than 100 m apart: of what lies straight between, 1 % is wrong.
  const double chord = std::hypot(2 * 40 * std::sin(2.5 / 2), 40 * 0.01 * 25);
  EXPECT_NEAR(kitti["by_length"][0]["t_rel_percent"].get<double>(), 0.01 * chord, 1e-5);
  EXPECT_EQ(figures(10, 10.1).find("KITTI"), std::string::npos) << "59 m";
  EXPECT_FALSE(nlohmann::json::parse(content(folder / "e.json")).contains("kitti"));
}

TEST(EvalCommand, HowManyPosesHaveAPartnerIsSaid) {
  const ScratchFolder folder;
  const auto estimate = write_circle(folder, "estimate.txt", 1);
  std::istringstream whole(content(write_circle(folder, "truth.txt", 1)));
  std::string some, line;
  for (int i = 0; i < 12 && std::getline(whole, line); ++i) some += line + "\n";
  const auto truth = folder.write("some.txt", some).string();
  const auto outcome = run(folder, "eval " + estimate + " " + truth + " --json " + (folder / "e.json"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(content(folder / "e.json"));
  EXPECT_LT(json["poses"], 13);
  EXPECT_EQ(json["poses_of_estimate"], 60);
  EXPECT_NE(outcome.out.find(json["poses"].dump() + " poses of 60 have a partner"), std::string::npos)
      << outcome.out;
}

/// The circle's times, multiplied: as text, for they get too large.
std::string write_in_unit(const ScratchFolder& folder, const std::string& name, std::int64_t per_second,
                          std::int64_t start_s) {
  std::string text;
  for (const TimedPose& pose : read_trajectory(write_circle(folder, "unit.txt", 1))) {
    const Eigen::Quaterniond& q = pose.T_w_c.so3().quaternion();
    const Vector3& t = pose.T_w_c.translation();
    const std::int64_t count = (start_s + pose.t_ns / 1'000'000'000) * per_second +
                               pose.t_ns % 1'000'000'000 / (1'000'000'000 / per_second);
    text += fmt::format("{}.000000 {} {} {} {} {} {} {}\n", count, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(),
                        q.w());
  }
  return folder.write(name, text).string();
}

TEST(EvalCommand, TheUnitOfTimesIsFoundByTheOtherFile) {
  const ScratchFolder folder;
  const auto poses = [&](const std::string& estimate, const std::string& truth, const std::string& said) {
    const auto outcome = run(folder, "eval " + estimate + " " + truth + " --json " + (folder / "e.json"));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_TRUE(said.empty() ? outcome.err.empty() : outcome.err.find(said) != std::string::npos)
        << outcome.err;
    return nlohmann::json::parse(content(folder / "e.json"))["poses"].get<int>();
  };
  for (const std::int64_t start_s : {0, 1'403'636'579}) {
    // write_circle begins at zero: the same path, at the given time in seconds.
    Trajectory moved = read_trajectory(write_circle(folder, "truth.txt", 1));
    for (TimedPose& pose : moved) pose.t_ns += start_s * 1'000'000'000;
    write_tum_trajectory(folder.path() / "truth.txt", moved);
    const std::string truth = folder / "truth.txt";
    for (const auto& [name, per_second] : {std::pair("milliseconds", 1'000LL),
                                           {"microseconds", 1'000'000LL},
                                           {"nanoseconds", 1'000'000'000LL}}) {
      SCOPED_TRACE(fmt::format("{} from {} s on", name, start_s));
      const std::string other = write_in_unit(folder, "other.txt", per_second, start_s);
      const bool certain = start_s > 0 && per_second == 1'000'000'000;
      const std::string said =
          certain ? "" : fmt::format("other.txt: time stamps are taken as {}, by which 60", name);
      EXPECT_EQ(poses(other, truth, said), 60);
      EXPECT_EQ(poses(truth, other, said), 60);
    }
  }
}

TEST(EvalCommand, WhereNothingIsCloseInTimeBothRangesAreSaid) {
  const ScratchFolder folder;
  const std::string early = write_in_unit(folder, "early.txt", 1'000'000'000, 1'403'636'579);
  const std::string late = write_in_unit(folder, "late.txt", 1'000'000'000, 1'503'636'579);
  expect_bad_input(run(folder, "eval " + early + " " + late),
                   "early.txt has 60 from 1403636579.000000000 to 1403636584.900000000 s");
  expect_bad_input(run(folder, "eval " + early + " " + late),
                   "late.txt has 60 from 1503636579.000000000 to 1503636584.900000000 s");
}

/// As a run leaves its trajectory that was killed within a write.
TEST(EvalCommand, ACutLastLineIsLeftOutAndSaid) {
  const ScratchFolder folder;
  const auto truth = write_circle(folder, "truth.txt", 1);
  const std::string whole = content(truth);
  for (const std::size_t cut :
       {2U, 9U, 40U}) {  // within the last number's decimals, before it, in the middle
    const auto killed = folder.write("killed.txt", whole.substr(0, whole.size() - cut)).string();
    const auto outcome = run(folder, "eval " + killed + " " + truth + " --json " + (folder / "e.json"));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_NE(outcome.err.find("killed.txt:61: the last line is cut, and left out"), std::string::npos)
        << outcome.err;
    EXPECT_EQ(nlohmann::json::parse(content(folder / "e.json"))["poses"], 59);
  }
  const auto unended = folder.write("unended.txt", whole.substr(0, whole.size() - 1)).string();
  const auto outcome = run(folder, "eval " + unended + " " + truth + " --json " + (folder / "e.json"));
  EXPECT_EQ(outcome.err, "") << "it is whole, only its line end is missing";
  EXPECT_EQ(nlohmann::json::parse(content(folder / "e.json"))["poses"], 60);
  const std::string middle =
      whole.substr(0, whole.find("\n", 200) - 30) + whole.substr(whole.find("\n", 200));
  expect_bad_input(run(folder, "eval " + folder.write("middle.txt", middle).string() + " " + truth),
                   "fields, 8 are needed");
}

/// Of a camera that looks along the body's y axis.
constexpr const char* kSensor =
    "T_BS:\n  data: [1, 0, 0, 0.3,  0, 0, 1, 0,  0, -1, 0, 0.1,  0, 0, 0, 1]\n"
    "resolution: [64, 48]\ncamera_model: pinhole\nintrinsics: [50, 50, 32, 24]\n";

TEST(EvalCommand, PosesOfTheBodyAreTurnedIntoTheCamerasOrItIsSaid) {
  const ScratchFolder folder;
  std::string body;
  const SE3 T_b_c(SO3::exp(Vector3(-std::numbers::pi / 2, 0, 0)), Vector3(0.3, 0, 0.1));
  Trajectory estimate;
  for (int i = 0; i < 60; ++i) {
    const SE3 T_w_b(SO3::exp(Vector3(0, 0, 0.1 * i)),
                    Vector3(std::cos(0.1 * i), std::sin(0.1 * i), 0.1 * std::sin(0.3 * i)));
    const Eigen::Quaterniond& q = T_w_b.so3().quaternion();
    const Vector3& t = T_w_b.translation();
    body += fmt::format("{},{},{},{},{},{},{},{}\n", 1'000'000'000 + i * 100'000'000LL, t.x(), t.y(), t.z(),
                        q.w(), q.x(), q.y(), q.z());
    estimate.push_back({1'000'000'000 + i * 100'000'000LL, T_w_b * T_b_c});
  }
  write_tum_trajectory(folder.path() / "estimate.txt", estimate);
  const std::string csv = folder.write("mav0/state_groundtruth_estimate0/data.csv", body).string();
  const auto eval = [&] {
    return run(folder, "eval " + (folder / "estimate.txt") + " " + csv + " --json " + (folder / "e.json"));
  };
  const auto alone = eval();
  EXPECT_EQ(alone.exit_code, 0) << alone.err;
  EXPECT_NE(alone.err.find("data.csv: these are poses of the body, not of the camera"), std::string::npos)
      << alone.err;
  folder.write("mav0/cam0/sensor.yaml", kSensor);
  const auto known = eval();
  EXPECT_EQ(known.exit_code, 0);
  EXPECT_EQ(known.err, "");
  const auto json = nlohmann::json::parse(content(folder / "e.json"));
  EXPECT_LT(json["ate_m"]["rmse"].get<double>(), 1e-6);
  EXPECT_LT(json["ate_rotation_deg"]["rmse"].get<double>(), 1e-4);
}

TEST(EvalCommand, AConstantTurnOfTheOrientationsIsSaid) {
  const ScratchFolder folder;
  const auto truth = write_circle(folder, "truth.txt", 1);
  Trajectory turned = read_trajectory(truth);
  for (TimedPose& pose : turned) pose.T_w_c = pose.T_w_c * SE3(SO3::exp(Vector3(1, 0, 0)), Vector3::Zero());
  write_tum_trajectory(folder.path() / "turned.txt", turned);
  const auto outcome = run(folder, "eval " + (folder / "turned.txt") + " " + truth);
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.err.find("the orientations differ by a constant turn of 57 deg"), std::string::npos)
      << outcome.err;
}

/// As of a car on a straight road: which way is up no position tells.
TEST(EvalCommand, OfAStraightPathTheTurnAboutItIsLeftOpen) {
  const ScratchFolder folder;
  Trajectory truth, estimate;
  for (int i = 0; i < 60; ++i) {
    const Vector3 x(0.01 * (i % 3), 0.01 * (i % 2), i), error(0.02 * (i % 2), 0.02 * (i % 3), 0);
    truth.push_back({i * 100'000'000LL, SE3(SO3(), x)});
    const SE3 rolled(SO3::exp(Vector3(0, 0, 0.5)), Vector3::Zero());
    estimate.push_back({i * 100'000'000LL, SE3(SO3(), rolled * x + error)});
  }
  write_tum_trajectory(folder.path() / "truth.txt", truth);
  write_tum_trajectory(folder.path() / "estimate.txt", estimate);
  const auto outcome = run(folder, "eval " + (folder / "estimate.txt") + " " + (folder / "truth.txt"));
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.err.find("the camera's"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("so straight"), std::string::npos) << outcome.err;
}

TEST(EvalCommand, PosesWithoutTimesNameTheFolderThatHasThem) {
  const ScratchFolder folder;
  const auto estimate = write_circle(folder, "estimate.txt", 1);
  const auto poses = folder.write("poses/06.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n").string();
  expect_bad_input(run(folder, "eval " + estimate + " " + poses),
                   "give the folder of the sequence instead (with its times.txt)");
  std::filesystem::create_directories(folder.path() / "sequences/06");
  expect_bad_input(run(folder, "eval " + estimate + " " + poses),
                   "give the folder of the sequence instead (" + (folder / "sequences/06") + ")");
}

TEST(EvalCommand, BadInputIsOneLineAndExitCodeTwo) {
  const ScratchFolder folder;
  const auto truth = write_circle(folder, "truth.txt", 1);
  const auto nan = folder.write("nan.txt", "1 0 0 0 0 0 0 1\n2 nan 0 0 0 0 0 1\n").string();
  const auto kitti = folder.write("kitti.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n").string();
  const auto late = folder.write("late.txt", "1000 0 0 0 0 0 0 1\n").string();
  const auto strange = folder.write("a\nb.txt", "1 x\n").string();
  expect_bad_input(run(folder, "eval " + nan + " " + truth), "nan.txt:2: 'nan' is not a finite number");
  expect_bad_input(run(folder, "eval " + truth + " " + nan), "nan.txt:2");
  expect_bad_input(run(folder, "eval " + truth + " " + kitti), "has no time stamps");
  expect_bad_input(run(folder, "eval " + late + " " + truth), "close in time");
  expect_bad_input(run(folder, "eval '" + strange + "' " + truth), "a?b.txt");
  expect_bad_input(run(folder, "eval " + (folder / "none.txt") + " " + truth),
                   "none.txt: no such trajectory file");
  expect_bad_input(run(folder, "eval " + truth + " " + (folder / "none")), "none: no such file or folder");
  expect_bad_input(run(folder, "eval " + truth + " " + truth + " --align fancy"), "align");
  expect_bad_input(run(folder, "eval " + truth + " " + truth + " --plot /nonexistent/p.png"),
                   "/nonexistent/p.png: the folder is not there");
  expect_bad_input(run(folder, "eval " + truth), "GROUNDTRUTH");
  expect_bad_input(run(folder, "eval --what"), "");
  expect_bad_input(run(folder, ""), "subcommand");
}

TEST(EvalCommand, HelpIsNoError) {
  const ScratchFolder folder;
  EXPECT_EQ(run(folder, "--help").exit_code, 0);
  EXPECT_EQ(run(folder, "eval --help").exit_code, 0);
}

}  // namespace
}  // namespace twofold
