#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include "io/sources/open_source.hpp"
#include "tests/apps/command.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// A rendered walk as 7-Scenes has it: numbers in the names, a depth image in millimetres and a matrix beside
/// each.
void render_as_seven_scenes(const ScratchFolder& folder, const std::string& name, int frames) {
  const auto source = open_source(fmt::format("synthetic:desk?sensor=rgbd&f=585&frames={}", frames));
  const double to_millimetres = source->rig().depth_unit * 1000;
  Frame frame;
  for (int i = 0; source->next(frame) == FrameStatus::kFrame; ++i) {
    const std::string begin = fmt::format("{}/frame-{:06d}.", name, i);
    folder.write_image(begin + "color.png", frame.left);
    cv::Mat depth;
    frame.depth.convertTo(depth, CV_16UC1, to_millimetres);
    depth.setTo(65535, depth == 0);
    folder.write_image(begin + "depth.png", depth);
    const Matrix4 T = source->ground_truth().at(static_cast<std::size_t>(i)).T_w_c.matrix();
    std::string text;
    for (int n = 0; n < 16; ++n) text += fmt::format("{:.7e}{}", T(n / 4, n % 4), n % 4 == 3 ? "\n" : "\t ");
    folder.write(begin + "pose.txt", text);
  }
}

TEST(PublicDatasetsCommand, ASequenceIsRunAndEvaluatedByItsPathAlone) {
  constexpr int kFrames = 30;
  const ScratchFolder folder;
  render_as_seven_scenes(folder, "desk/seq-01", kFrames);
  const std::string result = folder / "result";
  const Outcome outcome =
      run(folder, "run '" + (folder / "desk/seq-01") + "' --deterministic --out '" + result + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("calibration as published for 7-Scenes"), std::string::npos) << outcome.out;
  const auto summary = nlohmann::json::parse(content(result + "/summary.json"));
  EXPECT_EQ(summary["tracked"], kFrames);
  EXPECT_NE(summary["notes"].dump().find("as published for 7-Scenes"), std::string::npos);
  const Outcome evaluated = run(folder, "eval '" + result + "/trajectory.txt' '" + result +
                                            "/groundtruth.txt' --json '" + (folder / "eval.json") + "'");
  ASSERT_EQ(evaluated.exit_code, 0) << evaluated.err;
  const auto errors = nlohmann::json::parse(content(folder / "eval.json"));
  EXPECT_LT(errors["ate_m"]["rmse"].get<double>(), 0.01) << errors.dump();
}

TEST(PublicDatasetsCommand, WhatLiesBesideARecordingIsOneLineAndExitCodeTwo) {
  const ScratchFolder folder;
  folder.write("chess/seq-01/frame-000000.color.png", "x");
  folder.write("chess/seq-02/frame-000000.color.png", "x");
  folder.write("chess.zip", "x");
  const auto run_path = [&](const std::string& path) {
    return run(folder, "run '" + (folder / path) + "' --out '" + (folder / "result") + "'");
  };
  expect_bad_input(run_path("chess"), "is no recording, but has 2 in it: give one of them, as seq-01");
  expect_bad_input(run_path("chess.zip"), "is an archive: unpack it");
  expect_bad_input(run_path("chess/seq-01"), "frame-000000.color.png: no depth image has its number");
}

}  // namespace
}  // namespace twofold
