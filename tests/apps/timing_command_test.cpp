#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "engine/latency_histogram.hpp"
#include "tests/apps/command.hpp"

namespace twofold {
namespace {

/// 1000 durations, evenly from 0 to 10 ms times `factor`.
nlohmann::json times(double factor) {
  LatencyHistogram histogram;
  for (int i = 1; i <= 1000; ++i) histogram.record(static_cast<std::int64_t>(1e4 * factor * i));
  return histogram.to_json();
}

nlohmann::json file(double factor) {
  return {{"effort levels",
           {{"frames", {{"everything", 990}, {"fewer points", 10}}}, {"changes", nlohmann::json::array()}}},
          {"tracker", {{"frame", times(factor)}, {"search", times(0.5 * factor)}}},
          {"run", {{"frames", 1000}, {"wall_seconds", 20.0}, {"cpu_seconds", 5.0}, {"peak_rss_mb", 80.0}}}};
}

TEST(TimingCommand, ComparesRunsAndDrawsTheirLatencies) {
  const ScratchFolder folder;
  const auto base = folder.write("base.json", file(1).dump()).string();
  const auto slow = folder.write("slow/timing.json", file(2).dump()).string();
  const Outcome outcome =
      run(folder, "timing " + base + " " + (folder / "slow") + " --plot " + (folder / "p.png"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* part : {"tracker", "frame", "search", "p99.9", "1000", "+100 %", "5.00 CPU-ms a frame",
                           "everything 990, fewer points 10", "80 MB"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << "\n" << outcome.out;
  const cv::Mat picture = cv::imread(folder / "p.png");
  ASSERT_FALSE(picture.empty());
  for (const cv::Scalar& colour : {cv::Scalar(200, 90, 20), cv::Scalar(60, 130, 240)}) {
    cv::Mat mask;
    cv::inRange(picture, colour - cv::Scalar::all(8), colour + cv::Scalar::all(8), mask);
    EXPECT_GT(cv::countNonZero(mask), 300);
  }
}

TEST(TimingCommand, BadFilesAreOneLineAndExitCodeTwo) {
  const ScratchFolder folder;
  const std::string whole = file(1).dump(1);
  const auto refuse = [&](const std::string& text, const std::string& part) {
    const auto path = folder.write("t.json", text).string();
    expect_bad_input(run(folder, "timing " + path), "t.json");
    expect_bad_input(run(folder, "timing " + path), part);
  };
  for (const std::size_t length : {std::size_t{1}, whole.size() / 3, whole.size() - 3})
    refuse(whole.substr(0, length), "ends in the middle");
  refuse("", "ends in the middle");
  refuse("{\n\n  what}", "t.json:3: this is not JSON");
  refuse("[1]", "not a timing.json");
  refuse("{}", "not a timing.json");
  refuse(R"({"effort levels": {"frames": {"everything": -1}}})", "effort levels: 'everything' is no count");
  refuse(R"({"tracker": 3})", "tracker: is no table");
  refuse(R"({"tracker": {"frame": {"count": -1}}})", "'count' is no count");
  nlohmann::json json = file(1);
  json["tracker"]["frame"].erase("p99_9_ms");
  refuse(json.dump(), "tracker, frame: 'p99_9_ms' is missing");
  json = file(1);
  json["tracker"]["frame"]["count"] = 7;
  refuse(json.dump(), "hold 1000 durations");
  json = file(1);
  json["tracker"]["frame"]["mean_ms"] = "x";
  refuse(json.dump(), "'mean_ms' is no number");
  expect_bad_input(run(folder, "timing " + (folder / "none.json")), "none.json: no such file");
  expect_bad_input(run(folder, "timing"), "FILE");
}

}  // namespace
}  // namespace twofold
