#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "imaging/row_offset.hpp"
#include "io/files/mesh_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "tests/apps/command.hpp"

namespace twofold {
namespace {

const std::string kScene = "'synthetic:desk?sensor=rgbd&width=320&height=240&frames=60&noise=1'";

TEST(SurfaceCommand, DeterministicRunsGiveEqualBytes) {
  const ScratchFolder folder;
  for (const char* to : {"a", "b"}) {
    const Outcome outcome = run(
        folder, "run " + kScene + " --deterministic --surface 0.02 --quiet --out '" + (folder / to) + "'");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  const std::string mesh = content(folder / "a/surface.ply");
  ASSERT_FALSE(mesh.empty());
  EXPECT_EQ(mesh, content(folder / "b/surface.ply"));
  EXPECT_EQ(content(folder / "a/surface.glb"), content(folder / "b/surface.glb"));
  const auto summary = nlohmann::json::parse(content(folder / "a/summary.json"));
  EXPECT_GT(summary["surface"]["depth_images_fused"], 0);
  EXPECT_GT(summary["surface"]["triangles"], 1000);
}

TEST(SurfaceCommand, AlongTruePosesTheSurfaceIsTheTrueOne) {
  const ScratchFolder folder;
  ASSERT_EQ(run(folder, "surface " + kScene + " --poses truth --every 5 --voxel 0.01 --out '" +
                            (folder / "result") + "'")
                .exit_code,
            0);
  ASSERT_EQ(run(folder, "render " + kScene + " --surface '" + (folder / "truth.ply") + "' --seen '" +
                            (folder / "seen.ply") + "'")
                .exit_code,
            0);
  const Outcome compared =
      run(folder, "eval --surface '" + (folder / "result/surface.ply") + "' '" + (folder / "truth.ply") +
                      "' --seen '" + (folder / "seen.ply") + "' --json '" + (folder / "eval.json") +
                      "' --plot '" + (folder / "heat.png") + "'");
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  const auto figures = nlohmann::json::parse(content(folder / "eval.json"));
  EXPECT_LT(figures["accuracy"]["mean_m"], 0.002);
  EXPECT_GT(figures["completeness"]["within_threshold"], 0.85);
  EXPECT_FALSE(content(folder / "heat.png").empty());
  EXPECT_NE(compared.out.find("points 5 mm apart, distances cut at 100 mm"), std::string::npos)
      << compared.out;
  EXPECT_NE(compared.out.find("heat.png, red from 10 mm on"), std::string::npos) << compared.out;
}

/// Points lie where the mesh is, in its colours, and cover it.
TEST(SurfaceCommand, DepthImagesLieOverEachOtherInACloud) {
  const ScratchFolder folder;
  const Outcome outcome =
      run(folder, "surface " + kScene + " --poses truth --every 5 --voxel 0.02 --cloud '" +
                      (folder / "cloud.ply") + "' --out '" + (folder / "result") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const TriangleMesh cloud = read_ply_mesh(folder / "cloud.ply");
  const TriangleMesh mesh = read_ply_mesh(folder / "result/surface.ply");
  EXPECT_TRUE(cloud.triangles.empty());
  ASSERT_EQ(cloud.colours.size(), cloud.positions.size());
  ASSERT_GT(mesh.positions.size(), 1000U);
  int covered = 0, alike = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const auto nearest =
        std::min_element(cloud.positions.begin(), cloud.positions.end(), [&](const auto& a, const auto& b) {
          return (a - mesh.positions[v]).squaredNorm() < (b - mesh.positions[v]).squaredNorm();
        });
    if ((*nearest - mesh.positions[v]).norm() > 0.03F) continue;
    ++covered;
    const auto point = static_cast<std::size_t>(nearest - cloud.positions.begin());
    alike += std::abs(cloud.colours[point][0] - mesh.colours[v][0]) < 40 ? 1 : 0;
  }
  EXPECT_GT(covered, 0.95 * static_cast<double>(mesh.positions.size()));
  EXPECT_GT(alike, 0.9 * covered);
  EXPECT_LT(cloud.positions.size(), 4 * mesh.positions.size()) << "of a cube of a voxel one point";
}

/// A run that saw a wall of 2 x 2 m two metres before it, in a world of its own; truth.ply and
/// groundtruth.txt are as it was.
void write_run_before_wall(const ScratchFolder& folder, const Trajectory& truth, const Trajectory& estimate) {
  const SE3 T_e_w(SO3::exp(Vector3(0.3, -0.5, 0.2)), Vector3(1, 2, 3));
  TriangleMesh wall;
  for (const float x : {-1.0f, 1.0f}) {
    for (const float y : {-1.0f, 1.0f}) wall.positions.emplace_back(x, y, 2.0f);
  }
  wall.triangles = {{0, 1, 2}, {2, 1, 3}};
  write_ply_mesh(folder / "truth.ply", wall);
  for (Eigen::Vector3f& x : wall.positions) x = (T_e_w * Vector3(x.cast<double>())).cast<float>();
  write_ply_mesh(folder / "surface.ply", wall);
  Trajectory moved = estimate;
  for (TimedPose& pose : moved) pose.T_w_c = T_e_w * pose.T_w_c;
  write_tum_trajectory(folder / "trajectory.txt", moved);
  write_tum_trajectory(folder / "groundtruth.txt", truth);
}

double mean_accuracy(const ScratchFolder& folder, Outcome& outcome) {
  outcome = run(folder, "eval --surface '" + (folder / "surface.ply") + "' '" + (folder / "truth.ply") +
                            "' --json '" + (folder / "eval.json") + "'");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  if (outcome.exit_code != 0) return 1;
  return nlohmann::json::parse(content(folder / "eval.json"))["accuracy"]["mean_m"];
}

/// Four centimetres of way, at whose ends the depth is off by a millimetre: by positions, three degrees.
TEST(SurfaceCommand, AShortPathIsAlignedByOrientationsToo) {
  const ScratchFolder folder;
  Trajectory truth, estimate;
  for (int i = 0; i <= 40; ++i) {
    const SO3 R = SO3::exp(Vector3(0, 0.002 * i, 0));
    truth.push_back({1'000'000'000 + 33'000'000LL * i, SE3(R, Vector3(0.001 * i, 0, 0))});
    estimate.push_back({truth.back().t_ns, SE3(R, Vector3(0.001 * i, 0, 0.001 * (i - 20) / 20))});
  }
  write_run_before_wall(folder, truth, estimate);
  Outcome outcome;
  EXPECT_LT(mean_accuracy(folder, outcome), 0.0005) << outcome.out;
  EXPECT_NE(outcome.err.find("rests on the run's orientations"), std::string::npos) << outcome.err;
}

/// Positions of this run leave a degree of its rotation open, a centimetre of the surface. Its culled
/// keyframes are no loss of it.
TEST(SurfaceCommand, TheSurfaceOfAShortRunLiesOnTheTruth) {
  const ScratchFolder folder;
  const std::string scene = "'synthetic:desk?sensor=rgbd&width=320&height=240&frames=240&rounds=2'";
  const Outcome tracked = run(
      folder, "run " + scene + " --deterministic --quiet --surface 0.01 --out '" + (folder / "run") + "'");
  ASSERT_EQ(tracked.exit_code, 0) << tracked.err;
  EXPECT_NE(tracked.out.find("keyframes at most, culled because others see the same"), std::string::npos)
      << tracked.out;
  ASSERT_EQ(run(folder, "render " + scene + " --surface '" + (folder / "truth.ply") + "'").exit_code, 0);
  ASSERT_EQ(run(folder, "eval --surface '" + (folder / "run/surface.ply") + "' '" + (folder / "truth.ply") +
                            "' --json '" + (folder / "eval.json") + "'")
                .exit_code,
            0);
  const double mean = nlohmann::json::parse(content(folder / "eval.json"))["accuracy"]["mean_m"];
  std::printf("mean accuracy %.2f mm\n", 1e3 * mean);
  EXPECT_LT(mean, 0.0015);
}

/// A truth of positions alone says of each pose that it looks ahead.
TEST(SurfaceCommand, OrientationsThatContradictTheTruthAreLeftOut) {
  const ScratchFolder folder;
  Trajectory truth, estimate;
  for (int i = 0; i <= 40; ++i) {
    const Vector3 t(std::cos(0.1 * i), std::sin(0.1 * i), 0);
    truth.push_back({1'000'000'000 + 33'000'000LL * i, SE3(SO3(), t)});
    estimate.push_back({truth.back().t_ns, SE3(SO3::exp(Vector3(0, 0, 0.1 * i)), t)});
  }
  write_run_before_wall(folder, truth, estimate);
  Outcome outcome;
  EXPECT_LT(mean_accuracy(folder, outcome), 0.0005) << outcome.out;
  EXPECT_NE(outcome.err.find("by its run's positions alone"), std::string::npos) << outcome.err;
}

TEST(SurfaceCommand, ThreadedRunsAndFinishedRunsGiveSurfacesToo) {
  const ScratchFolder folder;
  const Outcome live =
      run(folder, "run " + kScene + " --surface 0.02 --quiet --out '" + (folder / "live") + "'");
  ASSERT_EQ(live.exit_code, 0) << live.err;
  EXPECT_NE(live.out.find("depth images fused"), std::string::npos);
  EXPECT_GT(read_ply_mesh(folder / "live/surface.ply").triangles.size(), 500u);
  const Outcome after = run(folder, "surface '" + (folder / "live") + "' --voxel 0.02 --out '" +
                                        (folder / "after") + "' --picture '" + (folder / "after/p.png") +
                                        "' --obj '" + (folder / "after/s.obj") + "'");
  ASSERT_EQ(after.exit_code, 0) << after.err;
  const TriangleMesh mesh = read_ply_mesh(folder / "after/surface.ply");
  EXPECT_GT(mesh.triangles.size(), 500u);
  EXPECT_EQ(mesh.normals.size(), mesh.positions.size());
  EXPECT_FALSE(content(folder / "after/p.png").empty());
  EXPECT_EQ(content(folder / "after/s.obj").rfind("# metres\nv ", 0), 0u);
}

/// Localised in the loaded map, it has no keyframe of its own.
TEST(SurfaceCommand, ARunInALoadedMapIsFusedAlongItsTrajectory) {
  const ScratchFolder folder;
  const std::string map = folder / "map.tfm";
  const std::string track = "run " + kScene + " --deterministic --quiet --out '";
  ASSERT_EQ(run(folder, track + (folder / "first") + "' --save-map '" + map + "'").exit_code, 0);
  ASSERT_EQ(run(folder, track + (folder / "second") + "' --localise-only --load-map '" + map + "'").exit_code,
            0);
  const Outcome fused = run(folder, "surface '" + (folder / "second") + "' --voxel 0.02");
  ASSERT_EQ(fused.exit_code, 0) << fused.err;
  const std::string along = content(folder / "second/trajectory.txt");
  const auto poses = std::count_if(along.begin(), along.end(), [](char c) { return c == '\n'; }) -
                     (along.rfind('#', 0) == 0 ? 1 : 0);
  EXPECT_NE(fused.out.find(std::to_string(poses) + " depth images fused"), std::string::npos) << fused.out;
}

TEST(SurfaceCommand, KeepsTheMeshUpToDateAndSaysHowFarItIsBehind) {
  const ScratchFolder folder;
  const Outcome live =
      run(folder, "run " + kScene + " --surface 0.02 --surface-live --quiet --out '" + (folder / "live") +
                      "' --obj '" + (folder / "mesh.obj") + "' --picture '" + (folder / "mesh.png") + "'");
  ASSERT_EQ(live.exit_code, 0) << live.err;
  EXPECT_EQ(content(folder / "mesh.obj").rfind("# metres\nv ", 0), 0u);
  EXPECT_FALSE(cv::imread(folder / "mesh.png").empty());
  EXPECT_NE(live.out.find("live mesh   behind the map by"), std::string::npos) << live.out;
  const auto surface = nlohmann::json::parse(content(folder / "live/summary.json"))["surface"];
  EXPECT_GT(surface["live_mesh"]["updates"], 0);
  EXPECT_GT(surface["live_mesh"]["maps"], 0);
  EXPECT_GT(surface["live_mesh"]["behind_max_ms"], 0);
  EXPECT_GT(surface["live_mesh"]["memory_mb"], 0);
}

/// In folder/NAME: a stereo run, and the surface of it when it is finished; right images lie `rows` lower.
void make_surfaces(const ScratchFolder& scratch, const std::string& name, double rows) {
  const auto in = [&](const std::string& what) { return scratch / (name + "/" + what); };
  const std::string scene = "'synthetic:desk?width=320&height=240&frames=40'";
  ASSERT_EQ(run(scratch, "render " + scene + " --out '" + in("recording") + "'").exit_code, 0);
  for (const auto& file : std::filesystem::directory_iterator(in("recording/mav0/cam1/data"))) {
    const cv::Mat right = cv::imread(file.path().string(), cv::IMREAD_GRAYSCALE);
    ASSERT_TRUE(cv::imwrite(file.path().string(), without_row_offset(right, -rows)));
  }
  const Outcome outcome = run(scratch, "run '" + in("recording") + "' --deterministic --quiet " +
                                           "--surface 0.02 --out '" + in("run") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  ASSERT_EQ(run(scratch, "surface '" + in("run") + "' --voxel 0.02 --out '" + in("after") + "'").exit_code,
            0);
}

TEST(SurfaceCommand, RowsThatSlippedAreTakenBackForTheSurfaceToo) {
  const ScratchFolder folder;
  make_surfaces(folder, "aligned", 0);
  make_surfaces(folder, "slipped", 2);
  for (const char* mesh : {"run/surface.ply", "after/surface.ply"}) {
    const Outcome outcome =
        run(folder, "eval --surface '" + (folder / (std::string("slipped/") + mesh)) + "' '" +
                        (folder / (std::string("aligned/") + mesh)) +
                        "' --align none --threshold 0.03 --json '" + (folder / "eval.json") + "'");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const auto figures = nlohmann::json::parse(content(folder / "eval.json"));
    const double right = figures["accuracy"]["within_threshold"];
    const double there = figures["completeness"]["within_threshold"];
    std::printf("%s: within 3 cm of that of aligned rows %.3f, of which there is %.3f\n", mesh, right, there);
    EXPECT_GT(right, 0.9) << mesh;
    EXPECT_GT(there, 0.9) << mesh;
  }
}

TEST(SurfaceCommand, OfARunGoesByTheCalibrationThatTheRunWasGiven) {
  const ScratchFolder folder;
  ASSERT_EQ(run(folder, "render " + kScene + " --out '" + (folder / "recording") + "'").exit_code, 0);
  std::ofstream(folder / "other.yaml")
      << "sensor: rgbd\nfps: 30\ncameras: [{size: [320, 240], intrinsics: [240, 240, 158, 119]}]\n"
         "depth: {unit: 0.001, min: 0.3, max: 8, virtual_baseline: 0.1}\n";
  ASSERT_EQ(run(folder, "run 'tum:" + (folder / "recording") + "' --calib '" + (folder / "other.yaml") +
                            "' --deterministic --quiet --out '" + (folder / "run") + "'")
                .exit_code,
            0);
  for (const auto& [to, given] :
       {std::pair{"a", std::string()}, {"b", " --calib '" + (folder / "other.yaml") + "'"}}) {
    const Outcome outcome = run(
        folder, "surface '" + (folder / "run") + "' --voxel 0.02" + given + " --out '" + (folder / to) + "'");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  EXPECT_TRUE(content(folder / "a/surface.ply") == content(folder / "b/surface.ply"));
}

/// The farther apart its cameras stand, the less do both see at once.
TEST(SurfaceCommand, OfAPairWhatBothCamerasSeeIsSeen) {
  const ScratchFolder folder;
  std::map<std::string, double> triangles;
  for (const std::string baseline : {"0.001", "0.2"}) {
    const std::string file = folder / (baseline + ".ply");
    const Outcome outcome =
        run(folder, "render 'synthetic:desk?width=320&height=240&frames=2&baseline=" + baseline +
                        "' --seen '" + file + "'");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    triangles[baseline] = static_cast<double>(read_ply_mesh(file).triangles.size());
  }
  std::printf("triangles seen: %.0f by cameras in one place, %.0f by cameras 20 cm apart\n",
              triangles["0.001"], triangles["0.2"]);
  EXPECT_LT(triangles["0.2"], 0.9 * triangles["0.001"]);
  EXPECT_GT(triangles["0.2"], 0.5 * triangles["0.001"]);
}

TEST(SurfaceCommand, SaysWhatHadNoPoseAndThatGreyWasAskedFor) {
  const ScratchFolder folder;
  const std::string scene = "'synthetic:desk?sensor=rgbd&width=160&height=120&frames=6'";
  std::ofstream(folder / "poses.txt") << "1 0 0 0 0 0 0 1\n";
  const Outcome outcome = run(folder, "surface " + scene + " --grey --voxel 0.02 --poses '" +
                                          (folder / "poses.txt") + "' --out '" + (folder / "result") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("5 frames of whose time"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("as asked for (--grey)"), std::string::npos) << outcome.out;
}

TEST(SurfaceCommand, SaysWhichImagesAreDamaged) {
  const ScratchFolder folder;
  const std::string recording = folder / "recording";
  ASSERT_EQ(run(folder,
                "render 'synthetic:desk?sensor=rgbd&width=160&height=120&frames=6' --out '" + recording + "'")
                .exit_code,
            0);
  std::vector<std::filesystem::path> depths;
  for (const auto& file : std::filesystem::directory_iterator(recording + "/mav0/depth0/data"))
    depths.push_back(file.path());
  std::sort(depths.begin(), depths.end());
  ASSERT_EQ(depths.size(), 6u);
  std::filesystem::resize_file(depths[2], 100);
  const Outcome outcome = run(folder, "surface 'tum:" + recording + "' --poses truth --voxel 0.02 --out '" +
                                          (folder / "result") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("left out: 1 frame with a damaged image"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find(depths[2].filename().string()), std::string::npos) << outcome.out;
}

TEST(SurfaceCommand, StereoGivesASurface) {
  const ScratchFolder folder;
  const std::string scene = "'synthetic:desk?width=320&height=240&frames=20'";
  const Outcome outcome = run(folder, "surface " + scene + " --poses truth --every 5 --voxel 0.02 --out '" +
                                          (folder / "result") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_GT(read_ply_mesh(folder / "result/surface.ply").triangles.size(), 500u);
}

TEST(SurfaceCommand, OfNoBlocksNothingIsSaidPerCubicMetre) {
  const ScratchFolder folder;
  const Outcome outcome =
      run(folder, "run 'synthetic:desk?bare=1&frames=3&width=160&height=120' --surface 0.05 --out '" +
                      (folder / "run") + "'");
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_NE(outcome.out.find(" 0 blocks, 0 MiB at most, colour"), std::string::npos) << outcome.out;
}

TEST(SurfaceCommand, ARunWithoutAMeshFailsAndSaysWhy) {
  const ScratchFolder folder;
  const Outcome outcome =
      run(folder, "run 'synthetic:desk?sensor=rgbd&width=320&height=240&frames=20' " +
                      std::string("--deterministic --quiet --surface 5 --out '") + (folder / "run") + "'");
  EXPECT_EQ(outcome.exit_code, 1) << outcome.out;
  EXPECT_NE(outcome.err.find("gave no surface: voxels of 5 m are too coarse"), std::string::npos)
      << outcome.err;
  const auto summary = nlohmann::json::parse(content(folder / "run/summary.json"));
  ASSERT_EQ(summary["errors"].size(), 1u);
}

/// A surface of fine voxels takes more memory in the end than before.
TEST(SurfaceCommand, ThePeakOfMemoryIsThatWithTheMesh) {
  const ScratchFolder folder;
  const std::string python =
      "python3 -c 'import resource, subprocess, sys; code = subprocess.call(sys.argv[1:]); "
      "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, file=sys.stderr); sys.exit(code)'";
  const Outcome outcome = run(folder,
                              "run 'synthetic:desk?sensor=rgbd&width=320&height=240&frames=30' "
                              "--deterministic --quiet --surface 0.004 --out '" +
                                  (folder / "run") + "'",
                              python);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const double peak = std::stod(outcome.err) / 1024;  // the kernel counts in KiB
  const double told = nlohmann::json::parse(content(folder / "run/summary.json"))["peak_rss_mb"];
  std::printf("peak %.1f MiB, told %.1f MiB\n", peak, told);
  EXPECT_NEAR(told, peak, 0.02 * peak);
}

/// A millimetre or less, read as a metre.
TEST(SurfaceCommand, AWrongUnitOfDepthShows) {
  const ScratchFolder folder;
  const std::string recording = folder / "recording";
  ASSERT_EQ(run(folder,
                "render 'synthetic:desk?sensor=rgbd&width=160&height=120&frames=3' --out '" + recording + "'")
                .exit_code,
            0);
  folder.write("unit.yaml",
               "sensor: rgbd\nfps: 30\ncameras: [{size: [160, 120], intrinsics: [120, 120, 79.5, 59.5]}]\n"
               "depth: {unit: 1, min: 0.3, max: 8, virtual_baseline: 0.1}\n");
  const Outcome outcome = run(folder, "surface 'tum:" + recording + "' --poses truth --voxel 0.02 --calib '" +
                                          (folder / "unit.yaml") + "' --out '" + (folder / "result") + "'");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.err.find("3 depth images without any reading from 0.3 to 8 m; theirs are from "),
            std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.err.find("by a unit of 1 m (depth: unit)"), std::string::npos) << outcome.err;
}

TEST(SurfaceCommand, SaysWhatCannotBe) {
  const ScratchFolder folder;
  const std::string to = " --out '" + (folder / "result") + "'";
  expect_bad_input(run(folder, "run 'synthetic:desk?sensor=mono&frames=5' --surface 0.01 --quiet" + to),
                   "is one camera, which gives no depth");
  folder.write("tiny.yaml",
               "sensor: stereo\ncameras:\n  - {size: [320, 240], intrinsics: [200, 200, 160, 120]}\n"
               "baseline: 0.0002\n");
  ASSERT_EQ(run(folder, "record 'synthetic:desk?frames=3&width=320&height=240' '" + (folder / "pair") + "'")
                .exit_code,
            0);
  folder.write("far.txt", "0 500000 4500000 100 0 0 0 1\n");
  expect_bad_input(run(folder, "surface '" + (folder / "pair") + "' --calib '" + (folder / "tiny.yaml") +
                                   "' --poses '" + (folder / "far.txt") + "'" + to),
                   "is that in metres?");
  expect_bad_input(
      run(folder, "surface '" + (folder / "pair") + "' --poses '" + (folder / "far.txt") + "'" + to),
      "shift the trajectory");
  std::ofstream(folder / "stray.ply")
      << "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
         "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1e9 0\n3 0 1 "
         "2\n";
  expect_bad_input(
      run(folder, "eval --surface '" + (folder / "stray.ply") + "' '" + (folder / "stray.ply") + "'"),
      "its largest triangle is number 0");
  expect_bad_input(run(folder, "run " + kScene + " --surface 0.00001 --quiet" + to), "voxel must be");
  for (const char* option : {"--surface-memory 100", "--surface-load 0.3", "--surface-live"})
    expect_bad_input(run(folder, "run " + kScene + " --quiet " + option + to), "requires --surface");
  expect_bad_input(run(folder, "surface " + kScene + " --poses truth --depth-noise 2" + to),
                   "twofold surface: depth_noise must be");
  expect_bad_input(run(folder, "surface '" + (folder / "nothing") + "'"), "nothing: no such file or folder");
  expect_bad_input(run(folder, "surface '" + folder.path().string() + "'"),
                   "not the folder of a finished run");
  expect_bad_input(run(folder, "surface 'synthetic:desk?sensor=mono&frames=5' --poses truth" + to),
                   "no depth");
  expect_bad_input(
      run(folder, "render 'synthetic:desk?sensor=mono&frames=5' --seen '" + (folder / "seen.ply") + "'"),
      "rgbd or stereo");
  std::ofstream(folder / "bad.ply")
      << "ply\nformat ascii 1.0\nelement vertex 99\nproperty float x\nend_header\n1";
  expect_bad_input(
      run(folder, "eval --surface '" + (folder / "bad.ply") + "' '" + (folder / "bad.ply") + "'"),
      "too short for 99");
  for (const char* option : {"--fit", "--seen a.ply", "--threshold 0.02"})
    expect_bad_input(run(folder, std::string("eval a.txt b.txt ") + option), "requires --surface");
  expect_bad_input(run(folder, "eval --surface a.ply b.ply --align sim3"), "sim3 is for trajectories");
  expect_bad_input(run(folder, "eval --surface a.ply b.ply --max-difference 0.1"), "excludes");
  for (const char* option : {"--obj", "--picture"})
    expect_bad_input(run(folder, "surface " + kScene + " --poses truth " + option + " '" +
                                     (folder / "none/file") + "'" + to),
                     "none/file: the folder is not there");
  for (const char* option : {"--json", "--plot"})
    expect_bad_input(run(folder, std::string("eval --surface a.ply b.ply ") + option + " '" +
                                     folder.path().string() + "'"),
                     std::string("is a folder, no file for ") + option);
  expect_bad_input(
      run(folder, "eval --surface '" + folder.path().string() + "' '" + (folder / "stray.ply") + "'"),
      folder.path().string() + ": is a folder, no PLY file");
  // Nothing within range: the near end of the desk is half a metre away.
  const Outcome empty = run(folder,
                            "surface 'synthetic:desk?sensor=rgbd&frames=3&width=160&height=120' --poses "
                            "truth --max-depth 0.31" +
                                to);
  EXPECT_EQ(empty.exit_code, 1);
  EXPECT_NE(empty.err.find("gave no surface: no reading is within 0.31 m (--max-depth)"), std::string::npos)
      << empty.err;
}

}  // namespace
}  // namespace twofold
