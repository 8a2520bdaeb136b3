#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/files/mesh_file.hpp"
#include "tests/apps/command.hpp"

namespace twofold {
namespace {

/// The first 71 degrees.
const std::string kScene = "'synthetic:turntable?sensor=rgbd&frames=60'";
const std::string kFew = "'synthetic:turntable?sensor=rgbd&frames=5'";

TEST(ObjectCommand, ModelsWhatTurnsBeforeAStaticCamera) {
  const ScratchFolder folder;
  for (const char* to : {"a", "b"}) {
    const Outcome outcome = run(folder, "object " + kScene + " --deterministic --out '" + (folder / to) +
                                            "' --picture '" + (folder / "picture.png") + "'");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_NE(outcome.out.find("turntable   "), std::string::npos);
  }
  EXPECT_EQ(content(folder / "a/surface.ply"), content(folder / "b/surface.ply"));
  EXPECT_FALSE(content(folder / "picture.png").empty());
  EXPECT_EQ(read_ply_mesh(folder / "a/cloud.ply").positions.size(),
            read_ply_mesh(folder / "a/surface.ply").positions.size());
  const auto object = nlohmann::json::parse(content(folder / "a/object.json"));
  EXPECT_NEAR(object["axis"]["rate_deg_s"], 36, 1);
  EXPECT_NEAR(object["axis"]["turned_deg"], 59 * 1.2, 2);
  EXPECT_NEAR(object["box"]["size_m"][0], 0.1, 0.01);
  EXPECT_NEAR(object["box"]["size_m"][1], 0.08, 0.01);
  EXPECT_NEAR(object["box"]["size_m"][2], 0.147, 0.006);  // its foot is left on the plate
}

// A round thing turns without its depth changing: prints alone say how far, and its outline stands still.
TEST(ObjectCommand, MetricLoopClosesTheTurnOfAJar) {
  const ScratchFolder folder;
  const Outcome outcome =
      run(folder, "object 'synthetic:turntable?sensor=rgbd&shape=1&frames=330' --deterministic --out '" +
                      (folder / "jar") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto jar = nlohmann::json::parse(content(folder / "jar/object.json"));
  EXPECT_GT(jar["metric_loops"], 0);
  EXPECT_EQ(jar["loops"], 0) << "appearance was needed";
  EXPECT_NEAR(jar["axis"]["turned_deg"], 329 * 1.2, 0.3);
}

TEST(ObjectCommand, SaysWhatIsMissing) {
  const ScratchFolder folder;
  const std::string out = " --out '" + (folder / "model") + "'";
  expect_bad_input(run(folder, "object 'synthetic:turntable?sensor=mono&frames=3'" + out), "stereo or RGB-D");
  expect_bad_input(run(folder, "object " + kFew + " --depth-cut 0.31" + out), "hardly any depth");
  expect_bad_input(run(folder, "object " + kFew + " --above 0.3" + out), "nothing is left above");
  expect_bad_input(run(folder, "object " + kFew + " --voxel 0" + out), "voxel");
  expect_bad_input(run(folder, "object " + kFew + " --picture '" + (folder / "none/p.png") + "'" + out),
                   "none/p.png: the folder is not there");
  const Outcome none =
      run(folder,
          "object 'synthetic:turntable?sensor=rgbd&width=160&height=120&frames=160' --depth-cut 0.31" + out);
  expect_bad_input(none, "none of the first 150 frames shows an object");
  EXPECT_EQ(none.err.find(": :"), std::string::npos) << none.err;
  const Outcome small =
      run(folder, "object 'synthetic:turntable?sensor=stereo&width=160&height=120&frames=8'" + out);
  EXPECT_EQ(small.exit_code, 1);
  EXPECT_NE(small.err.find("too small in the images"), std::string::npos) << small.err;
}

TEST(ObjectCommand, ModelsWhatACameraIsCarriedAround) {
  const ScratchFolder folder;
  const Outcome outcome =
      run(folder, "object 'synthetic:turntable?sensor=rgbd&motion=1&frames=75' --deterministic --out '" +
                      (folder / "carton") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const auto object = nlohmann::json::parse(content(folder / "carton/object.json"));
  EXPECT_EQ(object["share_cut_off"], 0);
  EXPECT_NEAR(object["box"]["size_m"][0], 0.1, 0.01);
  EXPECT_NEAR(object["box"]["size_m"][1], 0.08, 0.01);
  EXPECT_NEAR(object["box"]["size_m"][2], 0.147, 0.006);
}

TEST(ObjectCommand, ModelsWhatAHandTurnsOnlyIfItIsTold) {
  const ScratchFolder folder;
  const std::string object =
      "object 'synthetic:turntable?sensor=rgbd&motion=2&frames=60' --deterministic --out '" +
      (folder / "model") + "'";
  expect_bad_input(run(folder, object), "--held");
  const Outcome outcome = run(folder, object + " --held");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  // The space diagonal of a carton of 100 x 80 x 150 mm with 60 mm of a hand below, whichever way its box
  // lies.
  double square = 0;
  const auto model = nlohmann::json::parse(content(folder / "model/object.json"));
  for (const auto& edge : model["box"]["size_m"]) square += edge.get<double>() * edge.get<double>();
  EXPECT_GT(std::sqrt(square), 0.2);
  EXPECT_LT(std::sqrt(square), 0.33);
}

TEST(ObjectCommand, SaysThatWhatItModelsGoesOnBeyondTheImages) {
  const ScratchFolder folder;
  const Outcome near =
      run(folder, "object 'synthetic:turntable?sensor=rgbd&height=240&frames=60' --deterministic --out '" +
                      (folder / "near") + "'");
  ASSERT_EQ(near.exit_code, 0) << near.err;
  EXPECT_NE(near.err.find("100 % of the frames what is taken for the object reaches the image's border"),
            std::string::npos)
      << near.err;
}

TEST(ObjectCommand, SaysThatNothingTurned) {
  const ScratchFolder folder;
  const Outcome still =
      run(folder, "object 'synthetic:turntable?sensor=rgbd&frames=15' --deterministic --out '" +
                      (folder / "model") + "'");
  EXPECT_EQ(still.exit_code, 1);
  EXPECT_NE(still.err.find("seen from one side only, from directions that differ by 1"), std::string::npos)
      << still.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "model/object.json"));
}

}  // namespace
}  // namespace twofold
