#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include <fmt/format.h>

#include "tests/apps/command.hpp"
#include "tests/graph/sample_map.hpp"

namespace twofold {
namespace {

const std::string kDesk = "'synthetic:desk?frames=60&width=320&height=240'";

/// One mapped desk, saved once.
class MapCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new ScratchFolder;
    made_ = new Outcome(run(*shared_, "run " + kDesk + " --deterministic --quiet --out '" +
                                          (*shared_ / "made") + "' --save-map '" + map() + "'"));
  }
  static void TearDownTestSuite() {
    delete shared_;
    delete made_;
  }
  void SetUp() override { ASSERT_EQ(made_->exit_code, 0) << made_->err; }

  static std::string map() { return *shared_ / "desk.tfm"; }
  Outcome run_in_map(const std::string& options, const std::string& source = kDesk) const {
    return run(folder_, "run " + source + " --quiet --out '" + (folder_ / "result") + "' --load-map '" +
                            map() + "' " + options);
  }
  [[nodiscard]] nlohmann::json summary() const {
    return nlohmann::json::parse(content(folder_ / "result/summary.json"));
  }
  Outcome check(const std::string& bytes) const {
    const auto file = folder_.write("other.tfm", bytes);
    return run(folder_, "map check '" + file.string() + "'");
  }

  static ScratchFolder* shared_;
  static Outcome* made_;
  ScratchFolder folder_;
};
ScratchFolder* MapCommand::shared_ = nullptr;
Outcome* MapCommand::made_ = nullptr;

TEST_F(MapCommand, InfoCheckAndExport) {
  const Outcome info = run(folder_, "map info '" + map() + "'");
  ASSERT_EQ(info.exit_code, 0) << info.err;
  EXPECT_NE(info.out.find("stereo 320x240"), std::string::npos) << info.out;
  EXPECT_NE(info.out.find("corners)"), std::string::npos) << info.out;
  EXPECT_EQ(run(folder_, "map check '" + map() + "'").exit_code, 0);
  const Outcome out = run(folder_, "map export '" + map() + "' --ply '" + (folder_ / "a.ply") + "' --tum '" +
                                       (folder_ / "a.txt") + "' --g2o '" + (folder_ / "a.g2o") + "'");
  ASSERT_EQ(out.exit_code, 0) << out.err;
  for (const char* name : {"a.ply", "a.txt", "a.g2o"}) EXPECT_FALSE(content(folder_ / name).empty()) << name;
}

TEST_F(MapCommand, ExportHasAFileForEachPart) {
  const SavedMap two = testing::two_parts(testing::sample_map(20, 120, 1), testing::sample_map(11, 60, 2));
  const std::string file = folder_ / "two.tfm";
  save_map(file, two);
  const Outcome out = run(folder_, "map export '" + file + "' --ply '" + (folder_ / "p.ply") + "' --tum '" +
                                       (folder_ / "p.txt") + "' --g2o '" + (folder_ / "p.g2o") + "'");
  ASSERT_EQ(out.exit_code, 0) << out.err;
  const auto count = [](const std::string& text, const std::string& what) {
    std::size_t found = 0;
    for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++found;
    return found;
  };
  const auto poses = [&](const std::string& name) {
    const std::string text = content(folder_ / name);
    return count(text, "\n") - count(text, "#");
  };
  const std::size_t first = poses("p.txt"), second = poses("p-2.txt");
  EXPECT_GT(first, second);
  EXPECT_GT(second, 5U);
  EXPECT_EQ(first + second, count(content(folder_ / "p.g2o"), "VERTEX_SE3:QUAT"));
  EXPECT_EQ(count(content(folder_ / "p.g2o"), "FIX "), 2U);
  for (const char* name : {"p.ply", "p-2.ply"})
    EXPECT_EQ(count(content(folder_ / name), "element vertex 0"), 0U) << name;
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "p-3.txt"));
}

TEST_F(MapCommand, LocalisingLeavesTheMapAndSaysWhereItBegan) {
  const std::string before = content(map());
  const Outcome outcome = run_in_map("--deterministic --localise-only");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(content(map()), before);
  EXPECT_NE(outcome.out.find("recognised at frame 1"), std::string::npos) << outcome.out;
  const auto json = summary();
  EXPECT_EQ(json["loaded_map"]["recognised_at_frame"], 1);
  EXPECT_EQ(json["tracked"], 59);
  EXPECT_EQ(json["mapper_rounds"], 0);
}

/// Another lens and another number of pixels; poses in metres, because the map is.
TEST_F(MapCommand, AnotherCameraIsLocalisedInIt) {
  for (const char* lens : {"width=480&height=300&f=300", "width=288&height=216&f=170"}) {
    const Outcome outcome = run_in_map("--deterministic --localise-only --camera mono",
                                       "'synthetic:desk?frames=60&" + std::string(lens) + "'");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_GE(summary()["tracked"], 57) << lens;
    EXPECT_EQ(summary()["scale"], "metric");
    const Outcome eval =
        run(folder_, "eval '" + (folder_ / "result/trajectory.txt") + "' '" +
                         (folder_ / "result/groundtruth.txt") + "' --json '" + (folder_ / "eval.json") + "'");
    ASSERT_EQ(eval.exit_code, 0) << eval.err;
    const auto json = nlohmann::json::parse(content(folder_ / "eval.json"));
    EXPECT_LT(json["ate_m"]["rmse"], 0.01) << lens;
  }
  expect_bad_input(run_in_map("--localise-only", "'synthetic:desk?frames=6'"), "images are 640x480");
  expect_bad_input(run_in_map("--localise-only --camera mono", "'synthetic:desk?frames=6&f=2000'"),
                   "focal length");
}

/// From the first frame on, and recognised later where it is said to be elsewhere.
TEST_F(MapCommand, TheCameraIsPlacedWhereItIsSaidToBegin) {
  const auto first_index = [&](const std::string& pose) {
    const Outcome outcome = run_in_map("--deterministic --localise-only --initial-pose " + pose);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return summary()["loaded_map"]["recognised_at_frame"].get<int>();
  };
  std::ifstream poses(*shared_ / "made/trajectory.txt");
  std::string line, t, x, y, z, qx, qy, qz, qw;
  while (std::getline(poses, line) && line[0] == '#') {
  }
  std::istringstream(line) >> t >> x >> y >> z >> qx >> qy >> qz >> qw;
  EXPECT_EQ(first_index(fmt::format("{},{},{},{},{},{},{}", x, y, z, qx, qy, qz, qw)), 0);
  EXPECT_GT(first_index("-3,0,-5,0,1,0,0"), 0);
  expect_bad_input(run_in_map("--initial-pose 1,2,3"), "--initial-pose");
  expect_bad_input(run_in_map("--initial-pose 1,2,3,0,0,0,2"), "--initial-pose");
  expect_bad_input(run_in_map("--initial-pose 1,2,nan,0,0,0,1"), "--initial-pose");
  expect_bad_input(run(folder_, "run " + kDesk + " --initial-pose 0,0,0,0,0,0,1"), "--load-map");
}

/// A map in metres knows the focal length of whoever is localised in it.
TEST_F(MapCommand, AWrongFocalLengthIsTold) {
  const auto notes = [&](const std::string& error) {
    const Outcome outcome =
        run_in_map("--deterministic --localise-only --camera mono",
                   "'synthetic:desk?frames=60&width=320&height=240&f_error=" + error + "'");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return summary()["notes"].dump();
  };
  EXPECT_EQ(notes("0"), "[]");
  for (const auto& [error, share] : {std::pair("0.1", "9."), std::pair("-0.1", "11.")}) {
    const std::string told = notes(error);
    EXPECT_NE(told.find(std::string("the map shows a focal length ") + share), std::string::npos) << told;
    EXPECT_NE(told.find(error[0] == '-' ? "longer than" : "shorter than"), std::string::npos) << told;
  }
}

TEST_F(MapCommand, GoingOnTwiceGivesTheSameBytes) {
  std::string maps[2];
  for (int i = 0; i < 2; ++i) {
    const std::string file = folder_ / ("next" + std::to_string(i) + ".tfm");
    const Outcome outcome = run_in_map("--deterministic --checkpoint 0.7 --save-map '" + file + "'");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(run(folder_, "map check '" + file + "'").exit_code, 0);
    EXPECT_GT(summary()["checkpoints"]["saved"], 0);
    maps[i] = content(file);
  }
  EXPECT_FALSE(maps[0].empty());
  EXPECT_EQ(maps[0], maps[1]);
}

/// Their times are of another recording: of the same scene, they are even the same ones.
TEST_F(MapCommand, KeyframesOfTheLoadedMapAreKeptApart) {
  const Outcome outcome = run_in_map("--deterministic", "'synthetic:desk?frames=150&width=320&height=240'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto lines = [&](const char* name) {
    const std::string text = content(folder_ / (std::string("result/") + name));
    return std::count(text.begin(), text.end(), '\n') - 1;  // a line says what stands where
  };
  const auto own = lines("keyframes.txt"), loaded = lines("keyframes_loaded.txt");
  EXPECT_GT(own, 1);
  EXPECT_GT(loaded, 1);
  EXPECT_EQ(own + loaded, summary()["keyframes"]);
  EXPECT_NE(outcome.out.find("map         " + std::to_string(own + loaded) + " keyframes"), std::string::npos)
      << outcome.out;
  const Outcome eval = run(folder_, "eval '" + (folder_ / "result/keyframes.txt") + "' '" +
                                        (folder_ / "result/groundtruth.txt") + "'");
  ASSERT_EQ(eval.exit_code, 0) << eval.err;
  EXPECT_NE(eval.out.find(std::to_string(own) + " poses of " + std::to_string(own) + " have a partner"),
            std::string::npos)
      << eval.out;
}

TEST_F(MapCommand, PartsThatNeverJoinedAreMapsOfTheirOwn) {
  const std::string file = folder_ / "parts.tfm", second = folder_ / "parts-2.tfm";
  const Outcome outcome =
      run(folder_,
          "run 'synthetic:desk?frames=75&fps=15&width=320&height=240&cover_at=2&cover=0.3&elsewhere=9' "
          "--deterministic --quiet --out '" +
              (folder_ / "result") + "' --save-map '" + file + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto parts = summary()["map_parts"];
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_GE(parts[0]["frames"], parts[1]["frames"]);
  EXPECT_GT(parts[1]["frames"], 10);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "parts-3.tfm"));
  for (const std::string& map : {file, second}) {
    EXPECT_NE(outcome.out.find(map), std::string::npos) << outcome.out;
    const Outcome info = run(folder_, "map info '" + map + "'");
    ASSERT_EQ(info.exit_code, 0) << info.err;
    EXPECT_EQ(info.out.find("not connected"), std::string::npos) << info.out;
  }
  // Poses of one part are not mixed with those of the other.
  const auto lines = [&](const char* name) {
    const std::string text = content(folder_ / (std::string("result/") + name));
    return static_cast<int>(std::count(text.begin(), text.end(), '\n')) - 1;  // a line says what stands where
  };
  EXPECT_EQ(lines("trajectory.txt"), parts[0]["frames"]);
  EXPECT_EQ(lines("trajectory-2.txt"), parts[1]["frames"]);
}

TEST_F(MapCommand, ElsewhereItSaysThatNothingWasRecognised) {
  const Outcome outcome =
      run_in_map("--deterministic --localise-only", "'synthetic:corridor?frames=6&width=320&height=240'");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.err.find("no place of the loaded map was recognised"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.out.find("no place of it was recognised"), std::string::npos) << outcome.out;
  EXPECT_EQ(summary()["loaded_map"]["recognised"], false);
}

TEST_F(MapCommand, WrongUseIsOneLineAndExitCodeTwo) {
  const std::string folder = folder_.path().string();
  expect_bad_input(run_in_map("", "'synthetic:desk?frames=6'"), "images are 640x480, the map's are 320x240");
  const auto before = content(map());
  expect_bad_input(run(folder_, "map export '" + map() + "' --tum '" + map() + "'"), "is named twice");
  EXPECT_EQ(content(map()), before);
  expect_bad_input(
      run(folder_, "map export '" + map() + "' --tum '" + folder + "/x' --ply '" + folder + "/./x'"),
      "is named twice");
  expect_bad_input(run_in_map("--no-places"), "--load-map: needs places");
  expect_bad_input(run_in_map("--localise-only --save-map '" + folder + "/a.tfm'"), "--localise-only");
  expect_bad_input(run_in_map("--checkpoint 5"), "--checkpoint: needs --save-map");
  expect_bad_input(run_in_map("--checkpoint -1 --save-map '" + folder + "/a.tfm'"), "--checkpoint");
  expect_bad_input(run_in_map("--save-map '" + folder + "/none/a.tfm'"), "the folder is not there");
  expect_bad_input(run(folder_, "run " + kDesk + " --localise-only"), "needs --load-map");
  expect_bad_input(run(folder_, "run " + kDesk + " --load-map '" + folder + "/no.tfm'"), "cannot be opened");
}

TEST_F(MapCommand, DamagedMapsNameTheirSection) {
  const std::string good = content(map());
  expect_bad_input(check(good.substr(0, good.size() / 2)), "section");
  expect_bad_input(check(good.substr(0, good.size() - 3)), "section");
  expect_bad_input(check(good + "more"), "bytes follow after the end section");
  expect_bad_input(check(""), "too short to be a map");
  std::string flipped = good;
  flipped[good.size() - 300] ^= 0x10;  // in the last section but the end
  expect_bad_input(check(flipped), "(places): checksum is wrong");
  std::string oversized = good;
  oversized[8 + 4 + 7] = 0x40;  // the head's length
  expect_bad_input(check(oversized), "section 1 (head): reaches beyond the end of the file");
  expect_bad_input(run(folder_, "run " + kDesk + " --load-map '" + (folder_ / "other.tfm") + "'"),
                   "section 1 (head)");
}

TEST_F(MapCommand, KilledDuringCheckpointsAWholeMapIsLeft) {
  const std::string file = folder_ / "killed.tfm";
  const std::string command = std::string("exec ") + TWOFOLD_BINARY + " run " + kDesk +
                              " --speed 1 --quiet --checkpoint 0.01 --save-map '" + file + "' --out '" +
                              (folder_ / "killed") + "' >/dev/null 2>&1";
  for (int trial = 0; trial < 5; ++trial) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
      _exit(127);
    }
    for (int waited = 0; trial == 0 && !std::filesystem::exists(file) && waited < 6000; ++waited)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::this_thread::sleep_for(std::chrono::milliseconds(137 * trial));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    const Outcome outcome = run(folder_, "map check '" + file + "'");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }
}

}  // namespace
}  // namespace twofold
