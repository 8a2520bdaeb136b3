#include <fmt/format.h>

#include "tests/apps/command.hpp"

namespace twofold {
namespace {

TEST(ViewCommand, SaysWhatIsMissingOrWrong) {
  const ScratchFolder folder;
  expect_bad_input(run(folder, "view '" + (folder / "none.tfm") + "'"), "none.tfm");
  const std::string empty = folder / "empty";
  std::filesystem::create_directory(empty);
  expect_bad_input(run(folder, "view '" + empty + "'"), "summary.json: is missing");
  folder.write("empty/summary.json", "{");
  expect_bad_input(run(folder, "view '" + empty + "'"), "summary.json: is no JSON");
}

TEST(ViewCommand, AFilterIsNotViewed) {
  const ScratchFolder folder;
  expect_bad_input(
      run(folder, "run synthetic:desk?frames=2 --estimator swf --view --out '" + (folder / "run") + "'"),
      "--view: is not for --estimator swf");
}

TEST(ViewCommand, OptionsOfTheViewerNeedIt) {
  const ScratchFolder folder;
  const auto refused = [&](const std::string& options) {
    const Outcome outcome =
        run(folder, fmt::format("run 'synthetic:desk?frames=2' --out '{}' {}", folder / "run", options));
    EXPECT_FALSE(std::filesystem::exists(folder / "run")) << "nothing is begun";
    return outcome;
  };
  expect_bad_input(refused("--view-bind 127.0.0.1"), "--view-bind requires --view");
  expect_bad_input(refused("--view-control"), "--view-control requires --view");
  expect_bad_input(refused("--estimator swf --view-control"), "--view-control requires --view");
  for (const char* port : {"abc", "70000", "-1", "84x", "8420.0"})
    expect_bad_input(refused(fmt::format("--view={}", port)),
                     fmt::format("'{}' is no port: a number from 0 to 65535", port));
}

TEST(ViewCommand, RunSaysWhereToLook) {
  const ScratchFolder folder;
  const Outcome seen =
      run(folder, "run 'synthetic:desk?frames=20&width=320&height=240' --quiet --view 0 --out '" +
                      (folder / "run") + "'");
  if (seen.err.find("without the viewer") != std::string::npos) GTEST_SKIP() << "built without the viewer";
  EXPECT_EQ(seen.exit_code, 0) << seen.err;
  EXPECT_NE(seen.err.find("view at     http://127.0.0.1:"), std::string::npos) << seen.err;
  EXPECT_EQ(seen.err.find("unencrypted"), std::string::npos);
  const Outcome taken = run(
      folder,
      "run 'synthetic:desk?frames=2&width=320&height=240' --quiet --view 0 --view-bind 192.0.2.1 --out '" +
          (folder / "run") + "'");
  expect_bad_input(taken, "192.0.2.1");
}

}  // namespace
}  // namespace twofold
