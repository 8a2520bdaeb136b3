// What somebody is told who gives the program what it cannot use.
#include <fmt/format.h>

#include "tests/apps/command.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// Of KITTI's layout: three pairs of 64x48.
void write_recording(const ScratchFolder& folder, const std::string& name) {
  std::string times;
  for (int i = 0; i < 3; ++i) {
    for (const char* camera : {"image_0", "image_1"})
      folder.write_image(fmt::format("{}/{}/{:06}.png", name, camera, i), numbered_image(64, 48, i));
    times += fmt::format("{}\n", 0.1 * i);
  }
  folder.write(name + "/times.txt", times);
  folder.write(name + "/calib.txt", "P0: 50 0 32 0 0 50 24 0 0 0 1 0\nP1: 50 0 32 -10 0 50 24 0 0 0 1 0\n");
}

TEST(WrongInput, UnknownSubcommandsAreNamed) {
  const ScratchFolder folder;
  expect_bad_input(run(folder, "nosuch"), "'nosuch' is no subcommand; twofold --help lists them");
  expect_bad_input(run(folder, "map nosuch"), "'nosuch' is no subcommand; twofold map --help lists them");
  expect_bad_input(run(folder, "map"), "A subcommand is required; twofold map --help lists them");
  expect_bad_input(run(folder, ""), "A subcommand is required; twofold --help lists them");
}

TEST(WrongInput, UnknownOptionsAreNamedWithTheOneThatIsMeant) {
  const ScratchFolder folder;
  expect_bad_input(run(folder, "run synthetic:desk --ouT o1"),
                   "'--ouT' is no option of twofold run (--out?); --help lists them");
  expect_bad_input(run(folder, "run synthetic:desk --sped=2"),
                   "'--sped' is no option of twofold run (--speed?); --help lists them");
  expect_bad_input(run(folder, "run synthetic:desk --nonsense"),
                   "'--nonsense' is no option of twofold run; --help lists them\n");
  expect_bad_input(run(folder, "map info a.tfm b.tfm"),
                   "'b.tfm' was not expected; twofold map info --help says what is");
}

TEST(WrongInput, FilesThatAreNoVideoAreNotAskedForACalibration) {
  const ScratchFolder folder;
  const std::string text = folder.write("notes.txt", "no video\n").string();
  expect_bad_input(run(folder, "run " + text), "notes.txt: is not a video that can be decoded");
  expect_bad_input(run(folder, "run video:" + text), "is not a video that can be decoded");
}

TEST(WrongInput, FoldersWithoutTheLayoutThatIsNamed) {
  const ScratchFolder folder;
  write_recording(folder, "kitti");
  expect_bad_input(run(folder, "run euroc:" + (folder / "kitti")),
                   "kitti: holds neither mav0 nor cam0/data.csv, as EuRoC's recordings do");
}

TEST(WrongInput, FoldersInsteadOfFiles) {
  const ScratchFolder folder;
  write_recording(folder, "kitti");
  const std::string recording = folder / "kitti";
  expect_bad_input(run(folder, "run " + recording + " --calib " + recording),
                   "kitti: is a folder without cam0/sensor.yaml (EuRoC's): give a calibration file");
  for (const char* scheme : {"bag:", "mcap:"})
    expect_bad_input(run(folder, "run " + (scheme + recording)), "kitti: is a folder, not a file");
  expect_bad_input(run(folder, "map info " + recording), "kitti: cannot be opened: Is a directory");
  expect_bad_input(run(folder, "map info " + (folder / "none")),
                   "none: cannot be opened: No such file or directory");
}

TEST(WrongInput, ARunsFolderInsteadOfAFileInIt) {
  const ScratchFolder folder;
  const std::string out = folder / "run";
  ASSERT_EQ(run(folder, "run 'synthetic:desk?frames=3&width=320&height=240' --quiet --out " + out).exit_code,
            0);
  const std::string trajectory = out + "/trajectory.txt";
  expect_bad_input(run(folder, "eval " + out + " " + trajectory),
                   "run: is a folder: give its trajectory.txt");
  expect_bad_input(run(folder, "eval " + trajectory + " " + out),
                   "run: is the output folder of a run: give the run's source, or, for eval, a trajectory in "
                   "it (groundtruth.txt)");
  expect_bad_input(run(folder, "run " + out), "run: is the output folder of a run: give the run's source");
  expect_bad_input(run(folder, "surface " + (folder / "none")), "none: no such file or folder");
}

TEST(WrongInput, ACalibrationOfAnotherSizeIsNamed) {
  const ScratchFolder folder;
  write_recording(folder, "kitti");
  const std::string file = folder
                               .write("large.yaml",
                                      "sensor: stereo\nbaseline: 0.2\ncameras:\n"
                                      "  - {size: [640, 480], intrinsics: [500, 500, 320, 240]}\n")
                               .string();
  expect_bad_input(run(folder, "run " + (folder / "kitti") + " --calib " + file),
                   "000000.png: the image is 64x48, the calibration (" + file + ") is for 640x480");
}

TEST(WrongInput, NumbersOfOnePairForOneCameraAndTheOtherWayRound) {
  const ScratchFolder folder;
  write_recording(folder, "kitti");
  const std::string camera = "fx=50&fy=50&cx=32&cy=24";
  expect_bad_input(
      run(folder, "run 'images:" + (folder / "kitti/image_0") + "?fps=10&baseline=0.1&" + camera + "'"),
      "parameter baseline: is for two cameras, but there is one");
  const std::string file =
      folder
          .write("mono.yaml", "sensor: mono\ncameras:\n  - {size: [64, 48], intrinsics: [50, 50, 32, 24]}\n")
          .string();
  expect_bad_input(run(folder, "run " + (folder / "kitti") + " --calib " + file),
                   "mono.yaml: is not for a stereo camera, but there is a folder image_1");
}

/// A second layout in a recording's folder would be taken for the recording from then on.
TEST(WrongInput, NothingIsRecordedIntoTheSource) {
  const ScratchFolder folder;
  write_recording(folder, "kitti");
  const std::string recording = folder / "kitti";
  expect_bad_input(run(folder, "record " + recording + " " + recording),
                   "kitti: is the folder of the source");
  expect_bad_input(run(folder, "run " + recording + " --out " + (folder / "out_") + " --record " + recording),
                   "kitti: is the folder of the source: --record must name another one");
  EXPECT_FALSE(fs::exists(recording + "/mav0"));
}

TEST(WrongInput, ADoctorOfNoCameraTakesNoCalibration) {
  const ScratchFolder folder;
  expect_bad_input(run(folder, "doctor --calib " + folder.write("a.yaml", "x").string()),
                   "--calib requires SOURCE");
}

}  // namespace
}  // namespace twofold
